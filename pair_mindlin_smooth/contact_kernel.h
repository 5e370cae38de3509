// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// The forces of all neighbour pairs, in double or compensated arithmetic. No LAMMPS types.
//
// Pairs are told apart from contacts by their distance first. Contacts are then worked on in batches, with loops
// without branches that compilers turn into vector instructions; every operation on its own is that of IEEE 754, so
// that the width of the vectors changes nothing.

#ifndef FAULTGOUGE_CONTACT_KERNEL_H
#define FAULTGOUGE_CONTACT_KERNEL_H

#include "contact_pairs.h"
#include "mindlin_law.h"

namespace faultgouge {

// The disks of a rank, owned ones first; beyond them the coordinates are those that other owners have, not images.
struct Disks {
  int owned;
  const double *x, *v, *omega;    // three numbers a disk
  const double *radius;
  const double *low;                          // rows of fix low/parts; only compensated
  int low_columns;                            // and how long they are
  const Vector *elsewhere, *elsewhere_low;    // of disks owned elsewhere, null where nothing needs them
  const double *felt;                         // v_x, v_y, omega that dashpots feel, null without dashpots
};

// Lengths of the periodic box, and what they lack to a multiple of the grid
struct Period {
  double x, y, x_low, y_low;
};

template <class Number> struct Branch {
  Number x, y;
};

template <class Number> struct Geometry;

template <> struct Geometry<double> {
  double overlap, distance;
  FAULTGOUGE_INLINE double direction(double component) const { return component / distance; }
};

template <> struct Geometry<Compensated> {
  Compensated overlap, inverse;    // of the distance
  FAULTGOUGE_INLINE Compensated direction(Compensated component) const { return component * inverse; }
};

// from the second disk of a pair to the first, in the coordinates' high parts if these are compensated
FAULTGOUGE_INLINE Branch<double> leading_branch(const ContactPairs &pairs, int p, const Disks &disks, const Period &box)
{
  const int i = pairs.first[p], j = pairs.second[p];
  const double *const xi = disks.x + 3 * i, *const xj = disks.x + 3 * j;
  const auto image = pairs.image[p];
  if (image.x == 0 && image.y == 0) return {xi[0] - xj[0], xi[1] - xj[1]};
  const Vector other = j < disks.owned ? Vector{xj[0], xj[1]} : disks.elsewhere[j];
  return {(xi[0] - other.x) - image.x * box.x, (xi[1] - other.y) - image.y * box.y};
}

FAULTGOUGE_INLINE Branch<double> low_branch(const ContactPairs &pairs, int p, const Disks &disks, const Period &box)
{
  const int i = pairs.first[p], j = pairs.second[p];
  const double *const low = disks.low + disks.low_columns * i, *const low_j = disks.low + disks.low_columns * j;
  const auto image = pairs.image[p];
  const Vector other = j < disks.owned ? Vector{low_j[0], low_j[1]} : disks.elsewhere_low[j];
  return {(low[0] - other.x) - image.x * box.x_low, (low[1] - other.y) - image.y * box.y_low};
}

template <class Number> Branch<Number> branch(const ContactPairs &pairs, int p, const Disks &disks, const Period &box);

template <>
FAULTGOUGE_INLINE Branch<double> branch(const ContactPairs &pairs, int p, const Disks &disks, const Period &box)
{
  return leading_branch(pairs, p, disks, box);
}

template <>
FAULTGOUGE_INLINE Branch<Compensated> branch(const ContactPairs &pairs, int p, const Disks &disks, const Period &box)
{
  const Branch<double> high = leading_branch(pairs, p, disks, box), low = low_branch(pairs, p, disks, box);
  return {{high.x, low.x}, {high.y, low.y}};
}

// The overlap is not positive where the disks do not touch.
FAULTGOUGE_INLINE Geometry<double> geometry(const Branch<double> &r, double radius_i, double radius_j)
{
  const double distance = std::sqrt(r.x * r.x + r.y * r.y);
  return {(radius_i + radius_j) - distance, distance};
}

// On the grid the squares of the high parts and their sum are exact, and so is the difference of reach and distance, as
// the centre of neither disk lies inside of the other. What is lost is 1e-32 of the reach, less than the last place of
// a low part.
FAULTGOUGE_INLINE Geometry<Compensated> geometry(const Branch<Compensated> &r, double radius_i, double radius_j)
{
  const Compensated reach = exact_sum(radius_i, radius_j);
  const double rsq = r.x.high * r.x.high + r.y.high * r.y.high;
  const double rsq_low =
      __builtin_fma(__builtin_fma(2.0, r.x.high, r.x.low), r.x.low, __builtin_fma(2.0, r.y.high, r.y.low) * r.y.low);
  const auto [distance, inverse] = root_and_inverse(normalized({rsq, rsq_low}));
  return {normalized({reach.high - distance.high, reach.low - distance.low}), inverse};
}

// Of compensated coordinates, of the components of forces, and of tangential forces, which a small mu keeps small
struct Grids {
  FixedPointGrid coordinate;
  SummationGrid force, tangential;
};

// What a run has
struct Features {
  bool friction;
  bool advance;    // slips advance by v dt and omega dt
  bool damped;     // dashpots
  History history = History::TOTAL;
  bool energy = false;    // of contacts that sliding and dashpots take
};

// All pairs: their forces, slips and whether they touch. Returns a pair with one centre inside of the other disk, where
// the law means nothing, or -1. Compiled for several processors, of which the one at hand is chosen at run time;
// results are the same on all.
int contact_forces(ContactPairs &pairs, const Disks &disks, const Period &box, const MindlinLaw &law, double dt,
                   Features features);
int compensated_contact_forces(ContactPairs &pairs, const Disks &disks, const Period &box, const MindlinLaw &law,
                               double dt, Features features, const Grids &grids);

// A contact with the floor: n = (0, 1) and tau = (-1, 0)
template <class Number> struct FloorContact {
  Number normal, tangential, slip, slip_limit;
  double slid, dashpot_power;    // energy that sliding took in this step, and power of the dashpots; with energy
};

// how fast a contact with the floor opens and slips
struct FloorRates {
  double opening, slip;
};

FloorContact<double> floor_contact(const MindlinLaw &law, double overlap, double slip, double increment,
                                   const FloorRates &rates, Features features);
FloorContact<Compensated> floor_contact(const MindlinLaw &law, Compensated overlap, Compensated slip, double increment,
                                        const FloorRates &rates, Features features);

// Where forces go: rows of f and torque, and with compensated arithmetic of fix low/parts
struct Forces {
  double *const *f, *const *torque, *const *low;
  int low_fx, low_fy, low_torque;    // columns of low
};

// Each disk adds up its pairs in the order of the partners' IDs.
void sum_forces(const ContactPairs &pairs, const Disks &disks, const Forces &forces);
// Sums that the pairs have made already; the next ones begin at zero.
void take_compensated_forces(ContactPairs &pairs, const Disks &disks, const Forces &forces);

}    // namespace faultgouge

#endif
