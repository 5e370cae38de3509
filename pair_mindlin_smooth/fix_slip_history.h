// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// The slips of the contacts, kept with the disks: fix slip/history, made by pair mindlin/smooth.
//
// Row i of the per-atom array is [own ID, partner ID, slip, partner ID, slip, ..., 0, 0]: the contacts of
// disk i in the order of the partners' IDs; both partners keep theirs. In compensated arithmetic each slip is
// followed by its low part; with the keyword energy the energy that the contact has dissipated comes last. It is up to
// date whenever no run is under way, moves with the disks between ranks, and goes through restart files. Written from
// outside (library scatter) it takes effect in the next run.

#ifndef LMP_FIX_SLIP_HISTORY_H
#define LMP_FIX_SLIP_HISTORY_H

#include "fix.h"

namespace LAMMPS_NS {

// who holds the current slips while a run is under way
class SlipSource {
public:
  // puts them into the fix, if they are not there yet
  virtual void store_slips() = 0;

protected:
  ~SlipSource() = default;
};

class FixSlipHistory : public Fix {
public:
  static constexpr const char *ID = "slips";

  FixSlipHistory(class LAMMPS *, int, char **);
  ~FixSlipHistory() override;

  int setmask() override;
  void init() override;
  void post_run() override;
  int modify_param(int, char **) override;    // fix_modify slips capacity N: room for N contacts a disk

  void set_source(SlipSource *s) { source = s; }
  void check_owners() const;
  void check_ids() const;
  void clear(int i);
  bool compensated() const { return has_low; }
  bool energy() const { return has_energy; }
  void append(int i, tagint partner, double slip, double slip_low, double dissipated);
  const double *find(int i, tagint partner) const;    // what follows the partner; nullptr where there is no contact
  double dissipated(const double *found) const { return has_energy ? found[width - 2] : 0.0; }

  void grow_arrays(int) override;
  void copy_arrays(int, int, int) override;
  void set_arrays(int) override;
  int pack_exchange(int, double *) override;
  int unpack_exchange(int, double *) override;
  int pack_restart(int, double *) override;
  void unpack_restart(int, int) override;
  int size_restart(int) override;
  int maxsize_restart() override;
  double memory_usage() override;

private:
  SlipSource *source = nullptr;
  bool has_low = false, has_energy = false;
  int width = 2;    // numbers of a contact: partner, slip, the slip's low part if compensated, energy
  int capacity;     // contacts that a row holds
  int nmax = 0;

  void set_capacity(int);
  int count(int i) const;
};

}    // namespace LAMMPS_NS

#endif
