// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "fix_keep_histories.h"

#include "atom.h"
#include "error.h"
#include "modify.h"

#include <algorithm>
#include <cstring>

using namespace LAMMPS_NS;

FixKeepHistories::FixKeepHistories(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg), kept(atom->nmax)
{
  // what LAMMPS allows a fix beyond the largest number that it announces (BUFEXTRA in comm.cpp)
  constexpr int UNANNOUNCED = 1024;
  std::vector<double> sent;
  int longest = 0;
  for (int k = 0; k < atom->nextra_grow; k++) {
    Fix *const fix = modify->get_fix_by_index(atom->extra_grow[k]);
    owners.emplace_back(fix->id);
    for (int i = 0; i < atom->nlocal; i++) {
      // contacts read from a restart file are announced there alone
      const int announced = std::max(fix->maxexchange, fix->restart_peratom ? fix->size_restart(i) : 0);
      sent.resize(std::max<std::size_t>(sent.size(), announced + UNANNOUNCED));
      kept[i].insert(kept[i].end(), sent.data(), sent.data() + fix->pack_exchange(i, sent.data()));
      longest = std::max(longest, static_cast<int>(kept[i].size()));
    }
  }
  MPI_Allreduce(&longest, &maxexchange, 1, MPI_INT, MPI_MAX, world);
  maxexchange++;    // the length
  atom->add_callback(Atom::GROW);
}

FixKeepHistories::~FixKeepHistories()
{
  atom->delete_callback(id, Atom::GROW);
}

int FixKeepHistories::modify_param(int /*narg*/, char **arg)
{
  if (strcmp(arg[0], "restore") != 0) return 0;
  std::vector<Fix *> fixes;
  for (const auto &owner : owners) {
    fixes.push_back(modify->get_fix_by_id(owner));
    if (!fixes.back()) error->all(FLERR, "fix_modify {} restore: fix {} is no longer there", id, owner);
  }
  for (int i = 0; i < atom->nlocal; i++) {
    double *next = kept[i].data();
    for (Fix *const fix : fixes) next += fix->unpack_exchange(i, next);
  }
  return 1;
}

void FixKeepHistories::grow_arrays(int n)
{
  kept.resize(n);
}

void FixKeepHistories::copy_arrays(int i, int j, int /*delflag*/)
{
  kept[j] = kept[i];
}

int FixKeepHistories::pack_exchange(int i, double *buf)
{
  buf[0] = static_cast<double>(kept[i].size());
  std::copy(kept[i].begin(), kept[i].end(), buf + 1);
  return 1 + static_cast<int>(kept[i].size());
}

int FixKeepHistories::unpack_exchange(int nlocal, double *buf)
{
  const int n = static_cast<int>(buf[0]);
  kept[nlocal].assign(buf + 1, buf + 1 + n);
  return 1 + n;
}

double FixKeepHistories::memory_usage()
{
  double numbers = 0;
  for (const auto &each : kept) numbers += static_cast<double>(each.capacity());
  return numbers * sizeof(double);
}
