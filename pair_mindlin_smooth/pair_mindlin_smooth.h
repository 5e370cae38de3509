// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// pair_style mindlin/smooth KN KT MU [exponent P] [history KIND] [damping CN CT] [energy yes|no]
//   [compensated]
//
// Frictional disks in the plane: the law of mindlin_law.h with a slip history in fix slip/history. With
// MU = 0 or KT = 0 there is no tangential force, no history and no fix.
//
//   exponent      3/2 by default, or 1
//   history       total by default, or rescaled: slips are rescaled while overlaps grow (not with exponent 1), or
//                 coulomb: a spring behind Coulomb's slider
//   damping       dashpots at the contacts, which feel the velocities of fix dashpot/velocities; none by default, and
//                 none while fix displace/disc moves the disks
//   energy        each contact adds up what sliding and dashpots take; not by default
//   compensated   coordinates, slips and forces with low parts (compensated.h), kept in fix low/parts

#ifndef LMP_PAIR_MINDLIN_SMOOTH_H
#define LMP_PAIR_MINDLIN_SMOOTH_H

#include "contact_kernel.h"
#include "contact_pairs.h"
#include "fix_dashpot_velocities.h"
#include "fix_low_parts.h"
#include "fix_slip_history.h"
#include "mindlin_law.h"
#include "pair.h"

namespace LAMMPS_NS {

class PairMindlinSmooth : public Pair, public SlipSource {
public:
  PairMindlinSmooth(class LAMMPS *);
  ~PairMindlinSmooth() override;

  void settings(int, char **) override;
  void coeff(int, char **) override;
  void init_style() override;
  double init_one(int, int) override;
  void reinit() override;
  void compute(int, int) override;
  double single(int, int, int, int, double, double, double, double &) override;
  void *extract(const char *, int &) override;
  void write_restart(FILE *) override;
  void read_restart(FILE *) override;
  void write_restart_settings(FILE *) override;
  void read_restart_settings(FILE *) override;
  double memory_usage() override;
  int pack_forward_comm(int, int *, double *, int, int *) override;
  void unpack_forward_comm(int, int, double *) override;

  void store_slips() override;

private:
  faultgouge::MindlinLaw law;
  faultgouge::ContactPairs pairs;
  FixSlipHistory *history = nullptr;
  FixLowParts *low_parts = nullptr;
  FixDashpotVelocities *dashpots = nullptr;
  bool compensated = false;
  bool damping = false;                // the keyword was given
  bool damped = false;                 // as compiled into this run, at init
  bool energy = false;                 // the keyword says yes
  bool has_friction = false;           // as compiled into this run, at init
  bool slips_in_fix = true;            // false while pairs.slip is newer
  double *largest_radius = nullptr;    // of each type
  faultgouge::SummationGrid force_grid, tangential_grid;

  // LAMMPS adds box lengths to the coordinates of ghosts, with a rounding that depends on which of two disks
  // is the ghost; with the original coordinates both owners of a pair find the same to the bit
  std::vector<faultgouge::Vector> original, original_low;
  std::vector<double> felt;    // v_x, v_y, omega that dashpots feel, of owned and ghost disks

  void allocate();
  void make_fixes();
  void make_dashpots();
  void check_disks() const;
  void check_run() const;
  void check_box(double diameter) const;
  void check_integrators() const;
  void check_damping() const;
  double measure_radii();
  void set_force_grids();
  void rebuild_pairs();
  void load_slips();             // from the fix
  void sum_forces_on_owned();    // of owned disks
  void communicate_originals();
  faultgouge::Disks disks() const;
  faultgouge::Period period() const;
  int contact_forces(bool advance);
  void stop_at_crushed_pair(int pair) const;
  template <class NUMBER> void tally();
  int pair_of(int i, int j) const;
  template <class NUMBER> double measure(int pair, int i);
  template <class NUMBER> void add_dashpots(int pair, const faultgouge::Branch<NUMBER> &r);
};

}    // namespace LAMMPS_NS

#endif
