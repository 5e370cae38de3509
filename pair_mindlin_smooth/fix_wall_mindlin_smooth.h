// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// fix ID group wall/mindlin/smooth KN KT MU ylo COORD [exponent P] [history KIND] [damping CN CT] [energy yes|no]
//   [compensated]
//
// The flat floor at y = COORD below the disks: the law of mindlin_law.h with n = (0, 1), tau = (-1, 0).
// MU may be v_NAME, an equal-style variable that is evaluated in every step; fix_modify ID mu MU changes it, and
// fix_modify ID damping CN CT or damping no the dashpots. Each disk has one slip. The per-atom array has the columns of
// pair mindlin/smooth's single(): f_n, f_t, slip, slip/slip_limit, n_x, n_y, overlap, with compensated the slip's low
// part, with energy what sliding and dashpots have taken, and zeros for a disk that does not touch.

#ifndef LMP_FIX_WALL_MINDLIN_SMOOTH_H
#define LMP_FIX_WALL_MINDLIN_SMOOTH_H

#include "fix_disk_columns.h"
#include "mindlin_law.h"

namespace LAMMPS_NS {

class FixWallMindlinSmooth : public FixDiskColumns {
public:
  FixWallMindlinSmooth(class LAMMPS *, int, char **);

  int setmask() override;
  void init() override;
  void setup(int) override;
  void min_setup(int) override;
  void post_force(int) override;
  void min_post_force(int) override;
  double compute_scalar() override;
  int modify_param(int, char **) override;
  void *extract(const char *, int &) override;

  void change_mu(double);    // within a run

private:
  enum Column { NORMAL, TANGENTIAL, SLIP, SLIP_RATIO, NX, NY, OVERLAP, SLIP_LOW };

  faultgouge::MindlinLaw law;
  double height;
  double energy = 0.0;    // elastic energy of this rank's contacts
  bool has_friction = false;
  bool compensated = false;
  bool dissipating = false;    // the last column has the energy that sliding and dashpots have taken
  bool damping = false;        // the keyword was given
  bool damped = false;         // as compiled into this run, at init
  class FixLowParts *low_parts = nullptr;
  class FixDashpotVelocities *dashpots = nullptr;
  std::string mu_variable;    // empty where mu is a number
  int mu_index = -1;          // of that variable

  void find_dashpots();
  void set_mu(const char *);
  void update_mu();
  template <class NUMBER> NUMBER overlap_of(int i) const;
  template <class NUMBER> void choose_friction();
  template <class NUMBER, bool FRICTION, bool DAMPED> void contact_forces();
  template <class NUMBER, bool FRICTION, bool DAMPED> void contact_force(int i, NUMBER overlap);
  template <class NUMBER> void add_force(int i, NUMBER x, NUMBER y, NUMBER torque);
};

}    // namespace LAMMPS_NS

#endif
