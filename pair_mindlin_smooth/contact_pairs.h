// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// The neighbour pairs of one neighbour-list build, and for each disk its pairs in the order of the
// partners' IDs.
//
// A pair is evaluated once by each rank that owns one of its disks, a periodic image standing for its
// original; then each disk adds up its pairs in the order of IDs. The sum is therefore the same to the bit
// for any number of ranks, any order of the atoms in memory and newton on or off. In compensated arithmetic sums are
// exact, and are made as the pairs come.

#ifndef FAULTGOUGE_CONTACT_PAIRS_H
#define FAULTGOUGE_CONTACT_PAIRS_H

#include "lmptype.h"
#include "mindlin_law.h"

#include <vector>

namespace LAMMPS_NS {
class Atom;
class Domain;
class NeighList;
}    // namespace LAMMPS_NS

namespace faultgouge {

// four numbers, so that they load as one vector
struct alignas(32) PairForce {
  double x, y;          // on the first disk; the second one feels the opposite
  double tangential;    // f_t, the same for both: their torques are -R f_t
  double unused;
};

// the sum over the pairs of a disk, with low parts
struct alignas(64) CompensatedForce {
  PairForce high, low;
};

class ContactPairs {
public:
  // list: half list that holds the pairs with ghosts at both their owners (newton off). Its cutoff is that of the
  //   largest disks; pairs farther apart than their own reach and the skin cannot meet before the next list
  // original: coordinates of disks owned elsewhere, before LAMMPS shifted them by box lengths
  void build(const LAMMPS_NS::NeighList &list, double skin, LAMMPS_NS::Atom &atom, const LAMMPS_NS::Domain &domain,
             const std::vector<Vector> &original, bool with_slips, bool compensated, bool with_energy);

  int size() const { return static_cast<int>(first.size()); }

  // pairs of the owned disk i: entries start[i] .. start[i+1] of row, as 2*pair + (1 if i is the second)
  std::vector<int> start, row;
  std::vector<int> first, second;    // local indices; a ghost only if owned elsewhere
  struct Image {
    signed char x, y;    // box lengths between the second disk and its image that the first one meets
  };
  std::vector<Image> image;
  std::vector<LAMMPS_NS::tagint> first_tag, second_tag;    // and their IDs
  std::vector<PairForce> force;                            // not if compensated
  std::vector<CompensatedForce> disk_force;                // of the owned disks, only if compensated
  std::vector<double> slip, slip_low;                      // only with_slips
  std::vector<int> touching;                               // only with_slips
  std::vector<double> dissipated;                          // energy since the contact closed, only with_energy

private:
  void list_pairs(const LAMMPS_NS::NeighList &list, double skin, LAMMPS_NS::Atom &atom, const LAMMPS_NS::Domain &domain,
                  const std::vector<Vector> &original);
  void list_rows(const LAMMPS_NS::Atom &atom);
};

}    // namespace faultgouge

#endif
