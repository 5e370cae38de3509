// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// A fix with a row of numbers for each disk, of one length for all: the per-atom array moves with the disks between
// ranks and goes through restart files.

#ifndef LMP_FIX_DISK_COLUMNS_H
#define LMP_FIX_DISK_COLUMNS_H

#include "fix.h"

namespace LAMMPS_NS {

class FixDiskColumns : public Fix {
public:
  FixDiskColumns(class LAMMPS *, int, char **);
  ~FixDiskColumns() override;

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

protected:
  void make_columns(int);    // once, in the constructor; zeros at first

private:
  int nmax = 0;
};

}    // namespace LAMMPS_NS

#endif
