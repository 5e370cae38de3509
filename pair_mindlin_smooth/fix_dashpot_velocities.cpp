// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "fix_dashpot_velocities.h"

#include "atom.h"
#include "fix_disc_integrators.h"
#include "modify.h"

#include <algorithm>

using namespace LAMMPS_NS;
using namespace FixConst;

FixDashpotVelocities::FixDashpotVelocities(LAMMPS *lmp, int narg, char **arg) : FixDiskColumns(lmp, narg, arg)
{
  nevery = 1;
  make_columns(COLUMNS);
}

int FixDashpotVelocities::setmask()
{
  return PRE_FORCE | END_OF_STEP;
}

void FixDashpotVelocities::setup_pre_force(int /*vflag*/)
{
  for (int i = 0; i < atom->nlocal; i++) {
    double *const felt = array_atom[i], *const last = felt + FELT;
    const double now[FELT] = {atom->v[i][0], atom->v[i][1], atom->omega[i][2]};
    if (!std::equal(now, now + FELT, last)) std::copy(now, now + FELT, felt);
  }
}

void FixDashpotVelocities::pre_force(int /*vflag*/)
{
  for (int i = 0; i < atom->nlocal; i++) {
    double *const felt = array_atom[i], *const last = felt + FELT;
    felt[VX] = 2.0 * atom->v[i][0] - last[VX];
    felt[VY] = 2.0 * atom->v[i][1] - last[VY];
    felt[OMEGA] = 2.0 * atom->omega[i][2] - last[OMEGA];
  }
}

void FixDashpotVelocities::setup(int /*vflag*/)
{
  end_of_step();
}

void FixDashpotVelocities::end_of_step()
{
  for (int i = 0; i < atom->nlocal; i++) {
    double *const last = array_atom[i] + FELT;
    last[VX] = atom->v[i][0];
    last[VY] = atom->v[i][1];
    last[OMEGA] = atom->omega[i][2];
  }
}

bool LAMMPS_NS::displaces_disks(Modify &modify)
{
  for (const auto &fix : modify.get_fix_list())
    if (dynamic_cast<const FixDisplaceDisc *>(fix)) return true;
  return false;
}
