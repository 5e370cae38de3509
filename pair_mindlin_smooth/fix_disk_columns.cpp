// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "fix_disk_columns.h"

#include "atom.h"
#include "memory.h"

#include <algorithm>

using namespace LAMMPS_NS;

FixDiskColumns::FixDiskColumns(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
}

FixDiskColumns::~FixDiskColumns()
{
  if (!array_atom) return;    // its arguments were refused
  atom->delete_callback(id, Atom::GROW);
  atom->delete_callback(id, Atom::RESTART);
  memory->destroy(array_atom);
}

void FixDiskColumns::make_columns(int columns)
{
  restart_peratom = 1;
  create_attribute = 1;
  peratom_flag = 1;
  peratom_freq = 1;
  size_peratom_cols = columns;
  maxexchange = columns;
  grow_arrays(atom->nmax);
  atom->add_callback(Atom::GROW);
  atom->add_callback(Atom::RESTART);
  for (int i = 0; i < atom->nlocal; i++) set_arrays(i);
}

// room for thousands of disks more, which is not touched: rows of new disks are set or unpacked when they come
void FixDiskColumns::grow_arrays(int n)
{
  memory->grow(array_atom, n, size_peratom_cols, "disk/columns:array");
  nmax = n;
}

void FixDiskColumns::copy_arrays(int i, int j, int /*delflag*/)
{
  std::copy(array_atom[i], array_atom[i] + size_peratom_cols, array_atom[j]);
}

void FixDiskColumns::set_arrays(int i)
{
  std::fill(array_atom[i], array_atom[i] + size_peratom_cols, 0.0);
}

int FixDiskColumns::pack_exchange(int i, double *buf)
{
  std::copy(array_atom[i], array_atom[i] + size_peratom_cols, buf);
  return size_peratom_cols;
}

int FixDiskColumns::unpack_exchange(int nlocal, double *buf)
{
  std::copy(buf, buf + size_peratom_cols, array_atom[nlocal]);
  return size_peratom_cols;
}

// LAMMPS finds a fix's data in a restart file by the length that starts each record
int FixDiskColumns::pack_restart(int i, double *buf)
{
  buf[0] = size_peratom_cols + 1;
  return 1 + pack_exchange(i, buf + 1);
}

void FixDiskColumns::unpack_restart(int nlocal, int nth)
{
  double *extra = atom->extra[nlocal];
  int m = 0;
  for (int i = 0; i < nth; i++) m += static_cast<int>(extra[m]);
  set_arrays(nlocal);
  std::copy_n(extra + m + 1, std::min(static_cast<int>(extra[m]) - 1, size_peratom_cols), array_atom[nlocal]);
}

int FixDiskColumns::size_restart(int /*nlocal*/)
{
  return size_peratom_cols + 1;
}

int FixDiskColumns::maxsize_restart()
{
  return size_peratom_cols + 1;
}

double FixDiskColumns::memory_usage()
{
  return static_cast<double>(nmax) * size_peratom_cols * sizeof(double);
}
