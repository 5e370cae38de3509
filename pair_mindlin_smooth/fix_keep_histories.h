// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// fix ID all keep/histories
//
// A copy of what the fixes that are there keep for each atom, histories of contacts above all, as it is between two
// runs when this fix is made. The copy goes with the atoms to other places and ranks; fix_modify ID restore writes the
// copy back into those fixes, which must be there still. So zero steps can be run without a trace.

#ifndef LMP_FIX_KEEP_HISTORIES_H
#define LMP_FIX_KEEP_HISTORIES_H

#include "fix.h"

#include <string>
#include <vector>

namespace LAMMPS_NS {

class FixKeepHistories : public Fix {
public:
  FixKeepHistories(class LAMMPS *, int, char **);
  ~FixKeepHistories() override;

  int setmask() override { return 0; }
  int modify_param(int, char **) override;

  void grow_arrays(int) override;
  void copy_arrays(int, int, int) override;
  int pack_exchange(int, double *) override;
  int unpack_exchange(int, double *) override;
  double memory_usage() override;

private:
  std::vector<std::string> owners;          // IDs of the fixes
  std::vector<std::vector<double>> kept;    // of each atom, what the fixes send with it to another rank
};

}    // namespace LAMMPS_NS

#endif
