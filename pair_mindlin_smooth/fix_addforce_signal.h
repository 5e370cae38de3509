// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// fix ID group addforce/signal KIND ARGUMENTS [on layer|floor]
//
//   cosine A OMEGA                A cos(OMEGA t)
//   pulse A OMEGA                 Ricker's wavelet of height A whose spectrum peaks at OMEGA; it begins at t = 0
//   sweep A OMEGA OMEGA_END TIME  A sin(phi), whose frequency goes evenly from OMEGA to OMEGA_END in a TIME; then 0
//   record FILE [scale S] [stretch T]   a table of (time, value), on straight lines between its rows, 0 outside; FILE
//   may be v_NAME,
//                                 a variable that holds a name with blanks or quotes
//
// The force along x on each disk of the group at t = step*dt; with on floor, the acceleration a of the floor, which is
// the force -m a on each disk. It depends on the step alone, so that runs on any number of ranks, restarted runs and
// runs in several pieces see the same numbers. Global scalar: the signal's value.

#ifndef LMP_FIX_ADDFORCE_SIGNAL_H
#define LMP_FIX_ADDFORCE_SIGNAL_H

#include "fix.h"

#include <string>
#include <vector>

namespace LAMMPS_NS {

class FixAddForceSignal : public Fix {
public:
  FixAddForceSignal(class LAMMPS *, int, char **);
  int setmask() override;
  void init() override;
  void setup(int) override;
  void post_force(int) override;
  double compute_scalar() override;
  double memory_usage() override;

private:
  enum class Kind { COSINE, PULSE, SWEEP, RECORD };
  Kind kind;
  bool on_floor = false;
  double amplitude = 1.0, omega = 0.0, omega_end = 0.0, duration = 0.0;
  std::string file;
  std::vector<double> times, values;
  double scale = 1.0, stretch = 1.0;

  int read_kind(int, char **);    // returns the place of the first keyword
  void read_keywords(int, int, char **);
  void read_record();
  std::string read_table();
  double at(double time) const;
  double at_in_table(double time) const;
};

}    // namespace LAMMPS_NS

#endif
