// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// Low parts of coordinates and forces: fix low/parts, made by pair mindlin/smooth with the keyword compensated.
//
// Columns of the per-atom array: x, y (what the coordinates in x lack, see compensated.h), f_x, f_y, torque (what
// the forces in f and torque lack while a step is under way). A coordinate written from outside (data file,
// library scatter) is split at the next run's setup. Disks are wrapped into a periodic box here, before
// LAMMPS does so with a rounding.

#ifndef LMP_FIX_LOW_PARTS_H
#define LMP_FIX_LOW_PARTS_H

#include "atom.h"
#include "compensated.h"
#include "fix_disk_columns.h"

namespace LAMMPS_NS {

class FixLowParts : public FixDiskColumns {
public:
  static constexpr const char *ID = "low";
  enum Column { X, Y, FX, FY, TORQUE, COLUMNS };

  FixLowParts(class LAMMPS *, int, char **);

  int setmask() override;
  void setup_pre_exchange() override;
  void pre_exchange() override;

  void set_reach(double largest);    // of a contact
  const faultgouge::FixedPointGrid &grid() const { return spacing; }
  double period(int dimension) const;        // length of the box as a multiple of the grid
  double period_low(int dimension) const;    // and the rest
  void move(int i, double dx, double dy)
  {
    double *const high = atom->x[i], *const low = array_atom[i];
    const faultgouge::Compensated x = spacing.displace({high[0], low[X]}, dx),
                                  y = spacing.displace({high[1], low[Y]}, dy);
    high[0] = x.high;
    high[1] = y.high;
    low[X] = x.low;
    low[Y] = y.low;
  }
  void complete_force(int i)    // by its low part
  {
    double *const low = array_atom[i];
    atom->f[i][0] += low[FX];
    atom->f[i][1] += low[FY];
    atom->torque[i][2] += low[TORQUE];
    low[FX] = low[FY] = low[TORQUE] = 0.0;
  }

private:
  faultgouge::FixedPointGrid spacing;

  void wrap(int i, int dimension);
};

}    // namespace LAMMPS_NS

#endif
