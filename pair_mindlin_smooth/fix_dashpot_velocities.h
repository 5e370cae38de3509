// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// The velocities that dashpots feel: fix dashpot/velocities, made by pair mindlin/smooth with the keyword damping.
//
// LAMMPS asks for the forces of step n + 1 while velocities are those of the half step. Dashpots take
//
//   v_(n+1) = 2 v_(n+1/2) - v_n + O(dt^2)
//
// so that a damped run is of second order in the time step, as an undamped one is. The half step's velocity itself
// would make it first order.
//
// Columns of the per-atom array: v_x, v_y, omega that the last forces felt, and those of the last step's end. A run
// that goes on from where another one ended, by a restart file or not, begins with the forces that the other one ended
// with; a disk whose velocity was changed in between counts with the new one.

#ifndef LMP_FIX_DASHPOT_VELOCITIES_H
#define LMP_FIX_DASHPOT_VELOCITIES_H

#include "fix_disk_columns.h"

namespace LAMMPS_NS {

class FixDashpotVelocities : public FixDiskColumns {
public:
  static constexpr const char *ID = "dashpots";
  static constexpr int FELT = 3;    // numbers, the first ones of a row

  FixDashpotVelocities(class LAMMPS *, int, char **);

  int setmask() override;
  void setup_pre_force(int) override;
  void pre_force(int) override;
  void setup(int) override;
  void end_of_step() override;

private:
  enum Column { VX, VY, OMEGA, COLUMNS = 2 * FELT };
};

// Whether disks are moved as they would not move in time: without dashpots.
bool displaces_disks(class Modify &);

}    // namespace LAMMPS_NS

#endif
