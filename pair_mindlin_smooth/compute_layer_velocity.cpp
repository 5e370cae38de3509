// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "compute_layer_velocity.h"

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "exact_accumulator.h"
#include "update.h"

using namespace LAMMPS_NS;

ComputeLayerVelocity::ComputeLayerVelocity(LAMMPS *lmp, int narg, char **arg) : Compute(lmp, narg, arg)
{
  if (narg != 3) error->all(FLERR, "compute layer/velocity takes no arguments, but got {}", narg - 3);
  scalar_flag = 1;
  extscalar = 0;
}

double ComputeLayerVelocity::compute_scalar()
{
  invoked_scalar = update->ntimestep;
  scalar = mean_velocity(*atom, groupbit, world, comm->nprocs);
  return scalar;
}

double LAMMPS_NS::mean_velocity(const Atom &atom, int groupbit, MPI_Comm world, int ranks)
{
  faultgouge::ExactAccumulator all;
  for (int i = 0; i < atom.nlocal; i++)
    if (atom.mask[i] & groupbit) all.add(atom.v[i][0]);
  if (ranks > 1) MPI_Allreduce(MPI_IN_PLACE, all.integers(), all.SIZE, MPI_INT64_T, MPI_SUM, world);
  return all.mean();
}
