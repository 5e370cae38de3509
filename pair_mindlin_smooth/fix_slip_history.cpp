// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "fix_slip_history.h"

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "memory.h"

#include <algorithm>
#include <cmath>
#include <cstring>

using namespace LAMMPS_NS;
using namespace FixConst;

FixSlipHistory::FixSlipHistory(LAMMPS *lmp, int narg, char **arg) :
    Fix(lmp, narg, arg),
    capacity(8)    // six equal disks touch one; rows grow where a disk has more
{
  for (int k = 3; k < narg; k++) {
    if (strcmp(arg[k], "compensated") == 0) has_low = true;
    if (strcmp(arg[k], "energy") == 0) has_energy = true;
  }
  width += has_low + has_energy;
  restart_peratom = 1;
  create_attribute = 1;
  peratom_flag = 1;
  peratom_freq = 1;
  maxexchange_dynamic = 1;
  set_capacity(capacity);
  grow_arrays(atom->nmax);
  atom->add_callback(Atom::GROW);
  atom->add_callback(Atom::RESTART);
  for (int i = 0; i < atom->nlocal; i++) clear(i);
}

FixSlipHistory::~FixSlipHistory()
{
  atom->delete_callback(id, Atom::GROW);
  atom->delete_callback(id, Atom::RESTART);
  memory->destroy(array_atom);
}

int FixSlipHistory::setmask()
{
  return POST_RUN;
}

void FixSlipHistory::init()
{
  // gather and scatter want rows of one length on all ranks
  int widest;
  MPI_Allreduce(&capacity, &widest, 1, MPI_INT, MPI_MAX, world);
  set_capacity(widest);
  check_ids();
}

// rows hold the IDs of partners as doubles, in which whole numbers are exact up to 2^53
void FixSlipHistory::check_ids() const
{
  constexpr bigint LARGEST = bigint(1) << 53;
  bigint mine = 0, largest = 0;
  for (int i = 0; i < atom->nlocal; i++) mine = std::max(mine, static_cast<bigint>(atom->tag[i]));
  MPI_Allreduce(&mine, &largest, 1, MPI_LMP_BIGINT, MPI_MAX, world);
  if (largest > LARGEST)
    error->all(FLERR, "The slip history takes atom IDs up to 9007199254740992, and there is {}: number the disks anew",
               largest);
}

void FixSlipHistory::post_run()
{
  if (source) source->store_slips();
  init();
}

int FixSlipHistory::modify_param(int narg, char **arg)
{
  if (strcmp(arg[0], "capacity") != 0) return 0;
  if (narg < 2) error->all(FLERR, "fix_modify {} capacity takes the number of contacts of a disk", id);
  set_capacity(std::max(capacity, utils::inumeric(FLERR, arg[1], false, lmp)));
  return 2;
}

// delete_atoms and reset_atoms renumber the disks, and partners would be taken for others
void FixSlipHistory::check_owners() const
{
  for (int i = 0; i < atom->nlocal; i++)
    if (array_atom[i][0] != 0.0 && array_atom[i][0] != static_cast<double>(atom->tag[i]))
      error->one(FLERR, "Atom IDs were renumbered, so that the slip history no longer belongs to its contacts: use "
                        "delete_atoms with compress no, and do not use reset_atoms id");
}

void FixSlipHistory::clear(int i)
{
  std::fill(array_atom[i], array_atom[i] + size_peratom_cols, 0.0);
}

int FixSlipHistory::count(int i) const
{
  int n = 0;
  while (n < capacity && array_atom[i][1 + width * n] != 0.0) n++;
  return n;
}

// partners must come in the order of their IDs
void FixSlipHistory::append(int i, tagint partner, double slip, double slip_low, double dissipated)
{
  const int n = count(i);
  if (n == capacity) set_capacity(2 * capacity);
  double *entry = array_atom[i] + 1 + width * n;
  array_atom[i][0] = static_cast<double>(atom->tag[i]);
  entry[0] = static_cast<double>(partner);
  entry[1] = slip;
  if (has_low) entry[2] = slip_low;
  if (has_energy) entry[width - 1] = dissipated;
}

const double *FixSlipHistory::find(int i, tagint partner) const
{
  const double *const end = array_atom[i] + size_peratom_cols;
  for (const double *entry = array_atom[i] + 1; entry < end && entry[0] != 0.0; entry += width)
    if (entry[0] == static_cast<double>(partner)) return entry + 1;
  return nullptr;
}

void FixSlipHistory::set_capacity(int wanted)
{
  const int old_cols = array_atom ? size_peratom_cols : 0;
  capacity = wanted;
  size_peratom_cols = 1 + width * capacity;
  maxexchange = 1 + size_peratom_cols;
  if (!array_atom || size_peratom_cols == old_cols) return;

  double **wider;
  memory->create(wider, nmax, size_peratom_cols, "slip/history:array");
  for (int i = 0; i < nmax; i++) {
    std::fill(wider[i], wider[i] + size_peratom_cols, 0.0);
    std::copy(array_atom[i], array_atom[i] + std::min(old_cols, size_peratom_cols), wider[i]);
  }
  memory->destroy(array_atom);
  array_atom = wider;
}

void FixSlipHistory::grow_arrays(int n)
{
  memory->grow(array_atom, n, size_peratom_cols, "slip/history:array");
  for (int i = nmax; i < n; i++) clear(i);
  nmax = n;
}

void FixSlipHistory::copy_arrays(int i, int j, int /*delflag*/)
{
  if (source) source->store_slips();
  std::copy(array_atom[i], array_atom[i] + size_peratom_cols, array_atom[j]);
}

void FixSlipHistory::set_arrays(int i)
{
  clear(i);
}

int FixSlipHistory::pack_exchange(int i, double *buf)
{
  if (source) source->store_slips();
  const int n = 1 + width * count(i);
  buf[0] = n;
  std::copy(array_atom[i], array_atom[i] + n, buf + 1);
  return n + 1;
}

int FixSlipHistory::unpack_exchange(int nlocal, double *buf)
{
  const int n = static_cast<int>(buf[0]);
  if ((n - 1) / width > capacity) set_capacity((n - 1) / width);
  clear(nlocal);
  std::copy(buf + 1, buf + 1 + n, array_atom[nlocal]);
  return n + 1;
}

// LAMMPS finds a fix's data in a restart file by the length that starts each record
int FixSlipHistory::pack_restart(int i, double *buf)
{
  if (source) source->store_slips();
  const int n = 1 + width * count(i);
  buf[0] = n + 1;
  std::copy(array_atom[i], array_atom[i] + n, buf + 1);
  if (has_energy) buf[1] = -buf[1];    // says that energies follow
  return n + 1;
}

// the energies of contacts begin at zero where the file has none, and are left out where nobody wants them
void FixSlipHistory::unpack_restart(int nlocal, int nth)
{
  const double *extra = atom->extra[nlocal];
  int m = 0;
  for (int i = 0; i < nth; i++) m += static_cast<int>(extra[m]);
  const int n = static_cast<int>(extra[m++]) - 1;
  const double own = extra[m++];
  const int stored = width - has_energy + (own < 0.0), contacts = (n - 1) / stored;
  if (contacts > capacity) set_capacity(contacts);
  clear(nlocal);
  array_atom[nlocal][0] = std::fabs(own);
  for (int k = 0; k < contacts; k++)
    std::copy_n(extra + m + k * stored, std::min(stored, width), array_atom[nlocal] + 1 + k * width);
}

int FixSlipHistory::size_restart(int i)
{
  if (source) source->store_slips();
  return 2 + width * count(i);
}

int FixSlipHistory::maxsize_restart()
{
  return 2 + width * capacity;
}

double FixSlipHistory::memory_usage()
{
  return static_cast<double>(nmax) * size_peratom_cols * sizeof(double);
}
