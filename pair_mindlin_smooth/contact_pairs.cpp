// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "contact_pairs.h"

#include "atom.h"
#include "domain.h"
#include "neigh_list.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

using namespace LAMMPS_NS;

namespace faultgouge {

namespace {

// from ID to the index of an owned disk, -1 if it is owned elsewhere
class OwnedDisks {
public:
  explicit OwnedDisks(Atom &a) : atom(a)
  {
    if (atom.map_style != Atom::MAP_NONE) return;
    for (int i = 0; i < atom.nlocal; i++) index[atom.tag[i]] = i;
  }

  int find(tagint tag) const
  {
    if (atom.map_style != Atom::MAP_NONE) {
      const int i = atom.map(tag);
      return i < atom.nlocal ? i : -1;
    }
    const auto found = index.find(tag);
    return found == index.end() ? -1 : found->second;
  }

private:
  Atom &atom;
  std::unordered_map<tagint, int> index;    // only where LAMMPS keeps no map
};

ContactPairs::Image image_between(Vector seen, Vector original, const Domain &domain)
{
  return {static_cast<signed char>(std::lround((seen.x - original.x) / domain.prd[0])),
          static_cast<signed char>(std::lround((seen.y - original.y) / domain.prd[1]))};
}

bool within_reach(const Atom &atom, int i, int j, double skin)
{
  const double dx = atom.x[i][0] - atom.x[j][0], dy = atom.x[i][1] - atom.x[j][1];
  // a little more than the reach and the skin, for roundings and low parts of coordinates
  const double farthest = 1.000001 * (atom.radius[i] + atom.radius[j] + skin);
  return dx * dx + dy * dy <= farthest * farthest;
}

}    // namespace

void ContactPairs::build(const NeighList &list, double skin, Atom &atom, const Domain &domain,
                         const std::vector<Vector> &original, bool with_slips, bool compensated, bool with_energy)
{
  list_pairs(list, skin, atom, domain, original);
  list_rows(atom);
  if (compensated)
    disk_force.assign(atom.nlocal, CompensatedForce{});
  else
    force.assign(size(), PairForce{});
  if (!with_slips) return;
  slip.assign(size(), 0.0);
  if (compensated) slip_low.assign(size(), 0.0);
  touching.assign(size(), 0);
  if (with_energy) dissipated.assign(size(), 0.0);
}

void ContactPairs::list_pairs(const NeighList &list, double skin, Atom &atom, const Domain &domain,
                              const std::vector<Vector> &original)
{
  const int nlocal = atom.nlocal;
  const OwnedDisks owned(atom);
  first.clear();
  second.clear();
  image.clear();
  for (int ii = 0; ii < list.inum; ii++) {
    const int i = list.ilist[ii];
    for (int jj = 0; jj < list.numneigh[i]; jj++) {
      int j = list.firstneigh[i][jj] & NEIGHMASK;
      if (!within_reach(atom, i, j, skin)) continue;
      Image shift{0, 0};
      if (j >= nlocal) {
        const double *seen = atom.x[j];
        const int own = owned.find(atom.tag[j]);
        if (own >= 0) {
          if (own <= i) continue;    // the pair is listed from its other side, too
          j = own;
          shift = image_between({seen[0], seen[1]}, {atom.x[own][0], atom.x[own][1]}, domain);
        } else if (!original.empty()) {
          shift = image_between({seen[0], seen[1]}, original[j], domain);
        }
      }
      first.push_back(i);
      second.push_back(j);
      image.push_back(shift);
    }
  }
}

void ContactPairs::list_rows(const Atom &atom)
{
  const int nlocal = atom.nlocal;
  start.assign(nlocal + 1, 0);
  for (int p = 0; p < size(); p++) {
    start[first[p] + 1]++;
    if (second[p] < nlocal) start[second[p] + 1]++;
  }
  for (int i = 0; i < nlocal; i++) start[i + 1] += start[i];

  row.resize(start[nlocal]);
  first_tag.resize(size());
  second_tag.resize(size());
  std::vector<int> next(start.begin(), start.end() - 1);
  for (int p = 0; p < size(); p++) {
    first_tag[p] = atom.tag[first[p]];
    second_tag[p] = atom.tag[second[p]];
    row[next[first[p]]++] = 2 * p;
    if (second[p] < nlocal) row[next[second[p]]++] = 2 * p + 1;
  }

  const auto partner = [this](int entry) { return entry & 1 ? first_tag[entry >> 1] : second_tag[entry >> 1]; };
  for (int i = 0; i < nlocal; i++)
    std::sort(row.begin() + start[i], row.begin() + start[i + 1],
              [&](int a, int b) { return partner(a) < partner(b); });
}

}    // namespace faultgouge
