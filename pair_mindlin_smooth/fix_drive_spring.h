// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// fix ID group drive/spring K|rigid velocity V
// fix ID group drive/spring K|rigid protocol V1 TIME1 V2 TIME2 ...
//
// A spring whose far end moves along x draws a layer: the force K (U(t) - X) on each disk of the group. U is the way of
// the far end, V t, or piecewise V1 t, ... (the last velocity goes on); X is the mean displacement of the group along
// x, unwrapped over the period. Both count from the first setup. With rigid all disks of the group have the velocity
// of the far end along x and are free in y and in rotation.
//
// X is the same to the bit for any number of ranks (exact_accumulator.h): one reduction a step. Its origin goes through
// restart files. Global scalar: the force on each disk (with rigid: the mean force that holds the disks at their
// velocity); vector: X, U, the velocity of the far end.

#ifndef LMP_FIX_DRIVE_SPRING_H
#define LMP_FIX_DRIVE_SPRING_H

#include "exact_accumulator.h"
#include "fix.h"

#include <vector>

namespace LAMMPS_NS {

class FixDriveSpring : public Fix {
public:
  FixDriveSpring(class LAMMPS *, int, char **);
  int setmask() override;
  void init() override;
  void setup_post_neighbor() override;
  void post_neighbor() override;
  void setup(int) override;
  void post_force(int) override;
  void write_restart(FILE *) override;
  void restart(char *) override;
  double compute_scalar() override;
  double compute_vector(int) override;

private:
  struct Stage {
    double velocity, duration;
  };
  // where a run began: step, disks of the group, and the exact sum of their unwrapped x, taken negative
  struct Origin {
    bigint step = 0, disks = 0;
    faultgouge::ExactAccumulator less;
  };

  bool rigid = false, has_origin = false;
  double stiffness = 0.0;
  std::vector<Stage> protocol;
  std::vector<int> layer;    // this rank's disks of the group, which change their places with neighbour lists alone
  Origin origin;
  double force = 0.0, displacement = 0.0, way = 0.0, velocity = 0.0;
  class FixLowParts *low_parts = nullptr;    // null: plain doubles

  void read_protocol(int, char **);
  void move_far_end();
  // adds the unwrapped x of all ranks' disks, without a rounding; returns the number of disks
  bigint add_positions(faultgouge::ExactAccumulator &) const;
  double hold_layer();    // returns the mean force that it takes
};

}    // namespace LAMMPS_NS

#endif
