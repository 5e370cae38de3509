// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// compute ID group layer/velocity
//
// Mean velocity along x of the disks of the group. They are added up without a rounding (exact_accumulator.h), so that
// the mean is the same to the bit for any number of ranks, and with it a friction that depends on it.

#ifndef LMP_COMPUTE_LAYER_VELOCITY_H
#define LMP_COMPUTE_LAYER_VELOCITY_H

#include "compute.h"

namespace LAMMPS_NS {

class ComputeLayerVelocity : public Compute {
public:
  ComputeLayerVelocity(class LAMMPS *, int, char **);
  void init() override {}
  double compute_scalar() override;
};

// of a group, by its bit; one reduction, and none on a single rank
double mean_velocity(const class Atom &, int groupbit, MPI_Comm, int ranks);

}    // namespace LAMMPS_NS

#endif
