// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// fix ID group weaken/friction MU B W MU_SS V0 V_SS
//
// Friction of pair mindlin/smooth and of all floors that weakens with the mean velocity v of the group along x,
//
//   mu(v) = MU (B exp(-W (|v| - V0)/V_SS) + MU_SS)  for |v| > V0,  and MU otherwise,
//
// set before the forces of each step with the velocities of the half step. The mean is the same to the bit for any
// number of ranks (exact_accumulator.h) and takes one reduction. Global scalar: mu(v), vector: v, of the velocities as
// they stand. A run that goes on from where another one ended, by a restart file or not, begins with the friction that
// the other one ended with; if the mean velocity was changed in between, the new one counts.

#ifndef LMP_FIX_WEAKEN_FRICTION_H
#define LMP_FIX_WEAKEN_FRICTION_H

#include "fix.h"

#include <vector>

namespace LAMMPS_NS {

class FixWeakenFriction : public Fix {
public:
  FixWeakenFriction(class LAMMPS *, int, char **);
  int setmask() override;
  void init() override;
  void setup_pre_force(int) override;
  void pre_force(int) override;
  void post_run() override;
  void write_restart(FILE *) override;
  void restart(char *) override;
  double compute_scalar() override;
  double compute_vector(int) override;

private:
  double mu, b, w, mu_ss, v0, v_ss;
  double friction_velocity = 0.0;    // velocity of the last forces' friction
  double last = 0.0;                 // mean velocity when the last run ended
  bool has_last = false;
  double *of_pair = nullptr;
  std::vector<class FixWallMindlinSmooth *> floors;

  double friction(double velocity) const;
  double mean() const;
  void set_velocity(double velocity);
};

// Whether there is such a fix: friction that is zero now may come back.
bool friction_weakens(class Modify &);

}    // namespace LAMMPS_NS

#endif
