// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// The loop over the pairs, for one kind of numbers. No LAMMPS types. Included by the files that compile it for doubles
// and in compensated arithmetic.
//
// Contacts are worked on in batches: columns of numbers, and steps from branch vectors to forces. Each step is a loop
// without branches. Of friction, histories and dashpots a batch has what the run has; the loops that gather the columns
// and put the results where they belong are compiled for each case, as a question costs as much there as an answer.

#ifndef FAULTGOUGE_CONTACT_LOOP_H
#define FAULTGOUGE_CONTACT_LOOP_H

#include "contact_kernel.h"

#include <algorithm>
#include <cstring>
#include <type_traits>

// Fused multiply-add makes exact products fast, and vectors of four or eight do the rest.
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__)
#define FAULTGOUGE_DISPATCH __attribute__((target_clones("avx512f", "fma", "default")))
#else
#define FAULTGOUGE_DISPATCH
#endif

namespace faultgouge {

// so many contacts that their columns stay in the first-level cache
constexpr int BATCH = 64;

// aligned so that no vector straddles two cache lines
template <class Number> struct Column;

template <> struct alignas(64) Column<double> {
  double value[BATCH];
  FAULTGOUGE_INLINE double load(int k) const { return value[k]; }
  FAULTGOUGE_INLINE void store(int k, double number) { value[k] = number; }
};

template <> struct alignas(64) Column<Compensated> {
  double high[BATCH], low[BATCH];
  FAULTGOUGE_INLINE Compensated load(int k) const { return {high[k], low[k]}; }
  FAULTGOUGE_INLINE void store(int k, Compensated number)
  {
    high[k] = number.high;
    low[k] = number.low;
  }
};

template <class Number> struct Batch {
  int count = 0;
  int pair[BATCH];
  Column<Number> branch_x, branch_y, slip, overlap, normal, normal_x, normal_y, tangential, force_x, force_y;
  double radius_i[BATCH], radius_j[BATCH];
  double moved_x[BATCH], moved_y[BATCH], rolled[BATCH];    // in this step, only where slips advance
  double increment[BATCH];                                 // of the slip, the same
  double dissipated[BATCH];                                // in this step, only with energy
  double rate_x[BATCH], rate_y[BATCH], rolling[BATCH];     // v_ij and R_i omega_i + R_j omega_j, only with dashpots
};

// high parts of a contact cannot be farther apart than its reach and this
FAULTGOUGE_INLINE double margin(double, const FixedPointGrid &)
{
  return 0.0;
}
FAULTGOUGE_INLINE double margin(Compensated, const FixedPointGrid &grid)
{
  return 8.0 * grid.spacing;
}

// x, y and tangential force of a pair, and their signs for its first and its second disk
using Four = double __attribute__((vector_size(32)));
constexpr Four SIGN[2] = {{1.0, 1.0, 1.0, 1.0}, {-1.0, -1.0, 1.0, 1.0}};

FAULTGOUGE_INLINE void load(Four &four, const PairForce &numbers)
{
  static_assert(sizeof(Four) == sizeof(PairForce), "one vector");
  std::memcpy(&four, &numbers, sizeof(Four));
}

FAULTGOUGE_INLINE void add(PairForce &sum, const Four &more)
{
  Four total;
  load(total, sum);
  total += more;
  std::memcpy(&sum, &total, sizeof(Four));
}

FAULTGOUGE_INLINE void store_force(ContactPairs &pairs, int p, int, double x, double y, double tangential)
{
  pairs.force[p] = PairForce{x, y, tangential, 0.0};
}

FAULTGOUGE_INLINE void store_force(ContactPairs &pairs, int p, int owned, Compensated x, Compensated y,
                                   Compensated tangential)
{
  const int i = pairs.first[p], j = pairs.second[p];
  const Four high{x.high, y.high, tangential.high, 0.0}, low{x.low, y.low, tangential.low, 0.0};
  add(pairs.disk_force[i].high, high);
  add(pairs.disk_force[i].low, low);
  if (j >= owned) return;
  add(pairs.disk_force[j].high, SIGN[1] * high);
  add(pairs.disk_force[j].low, SIGN[1] * low);
}

template <class Number, bool FRICTION> FAULTGOUGE_INLINE void open(ContactPairs &pairs, int p)
{
  if constexpr (std::is_same_v<Number, double>) pairs.force[p] = PairForce{};
  if constexpr (FRICTION) pairs.touching[p] = 0;
}

FAULTGOUGE_INLINE double known_slip(double, const ContactPairs &pairs, int p)
{
  return pairs.slip[p];
}
FAULTGOUGE_INLINE Compensated known_slip(Compensated, const ContactPairs &pairs, int p)
{
  return {pairs.slip[p], pairs.slip_low[p]};
}

template <bool FRICTION, bool ADVANCE, bool DAMPED, class Number>
FAULTGOUGE_INLINE void add(Batch<Number> &batch, const ContactPairs &pairs, int p, const Branch<Number> &r,
                           const Disks &disks, double dt)
{
  const int k = batch.count++, i = pairs.first[p], j = pairs.second[p];
  batch.pair[k] = p;
  batch.branch_x.store(k, r.x);
  batch.branch_y.store(k, r.y);
  batch.radius_i[k] = disks.radius[i];
  batch.radius_j[k] = disks.radius[j];
  if constexpr (DAMPED) {
    const double *const fi = disks.felt + 3 * i, *const fj = disks.felt + 3 * j;
    batch.rate_x[k] = fi[0] - fj[0];
    batch.rate_y[k] = fi[1] - fj[1];
    batch.rolling[k] = disks.radius[i] * fi[2] + disks.radius[j] * fj[2];
  }
  if constexpr (!FRICTION) return;

  const bool known = pairs.touching[p];
  batch.slip.store(k, known ? known_slip(Number(), pairs, p) : Number(0.0));
  if constexpr (ADVANCE) {
    const double *const vi = disks.v + 3 * i, *const vj = disks.v + 3 * j;
    const double step = known ? dt : 0.0;    // a new contact begins without slip
    batch.moved_x[k] = (vi[0] - vj[0]) * step;
    batch.moved_y[k] = (vi[1] - vj[1]) * step;
    batch.rolled[k] = (disks.radius[i] * disks.omega[3 * i + 2] + disks.radius[j] * disks.omega[3 * j + 2]) * step;
  }
}

// overlaps, directions and normal forces
template <class P, class Number> FAULTGOUGE_INLINE void normal_forces(Batch<Number> &batch, const MindlinLaw law)
{
  for (int k = 0; k < batch.count; k++) {
    const Branch<Number> r{batch.branch_x.load(k), batch.branch_y.load(k)};
    const Geometry<Number> contact = geometry(r, batch.radius_i[k], batch.radius_j[k]);
    const Number normal = law.normal_force<P>(contact.overlap);
    batch.overlap.store(k, contact.overlap);
    batch.normal.store(k, normal);
    batch.normal_x.store(k, contact.direction(r.x));
    batch.normal_y.store(k, contact.direction(r.y));
  }
}

template <class P, bool RESCALE, class Number> FAULTGOUGE_INLINE void slip_increments(Batch<Number> &batch)
{
  for (int k = 0; k < batch.count; k++) {
    const Vector r{value(batch.branch_x.load(k)), value(batch.branch_y.load(k))};
    const Vector moved{batch.moved_x[k], batch.moved_y[k]};
    double increment = midpoint_slip(r, moved) - batch.rolled[k];
    if constexpr (RESCALE)
      increment = rescaled_increment<P>(value(batch.slip.load(k)), increment, overlap_change(r, moved),
                                        value(batch.overlap.load(k)));
    batch.increment[k] = increment;
  }
}

template <bool ADVANCE, bool SLIDER, class Number>
FAULTGOUGE_INLINE void tangential_forces(Batch<Number> &batch, const MindlinLaw law)
{
  const Number limit_ratio = law.slip_limit_ratio<Number>();
  for (int k = 0; k < batch.count; k++) {
    const Number limit = limit_ratio * batch.overlap.load(k);
    Number slip = batch.slip.load(k);
    if constexpr (ADVANCE) {
      slip = advanced_slip(slip, batch.increment[k], limit);
      batch.slip.store(k, slip);
    }
    batch.tangential.store(k, law.tangential_force<SLIDER>(batch.normal.load(k), slip, limit));
  }
}

// Slips, advanced if wanted, and tangential forces. With energy also what sliding takes: what the bound has taken from
// the slip, times the force.
template <class P, class Number>
FAULTGOUGE_INLINE void friction(Batch<Number> &batch, const MindlinLaw law, Features features)
{
  const bool slider = features.history == History::COULOMB;
  if (!features.advance)
    return slider ? tangential_forces<false, true>(batch, law) : tangential_forces<false, false>(batch, law);
  if (P::EXPONENT > 1.0 && features.history != History::TOTAL)
    slip_increments<P, (P::EXPONENT > 1.0)>(batch);
  else
    slip_increments<P, false>(batch);
  if (features.energy)
    for (int k = 0; k < batch.count; k++) batch.dissipated[k] = value(batch.slip.load(k)) + batch.increment[k];
  slider ? tangential_forces<true, true>(batch, law) : tangential_forces<true, false>(batch, law);
  if (features.energy)
    for (int k = 0; k < batch.count; k++)
      batch.dissipated[k] = (value(batch.slip.load(k)) - batch.dissipated[k]) * value(batch.tangential.load(k));
}

// after the elastic forces, since friction is bounded by the elastic normal force
template <class P, bool FRICTION, bool ENERGY, class Number>
FAULTGOUGE_INLINE void add_dashpots(Batch<Number> &batch, const MindlinLaw law, double dt)
{
  for (int k = 0; k < batch.count; k++) {
    const double nx = value(batch.normal_x.load(k)), ny = value(batch.normal_y.load(k));
    const double overlap = value(batch.overlap.load(k)), rate_x = batch.rate_x[k], rate_y = batch.rate_y[k];
    const Number normal = batch.normal.load(k);
    const double opening = nx * rate_x + ny * rate_y;
    batch.normal.store(k, law.damped_normal<P>(normal, overlap, opening));
    if constexpr (FRICTION) {
      const double slip_rate = (nx * rate_y - ny * rate_x) - batch.rolling[k];
      const Number elastic = batch.tangential.load(k);
      const Number sum = law.damped_tangential<P>(elastic, normal, overlap, slip_rate);
      batch.tangential.store(k, sum);
      if constexpr (ENERGY)
        batch.dissipated[k] += dt * law.dashpot_power<P>(overlap, opening, slip_rate, value(elastic), value(sum));
    }
  }
}

// as they are added up
FAULTGOUGE_INLINE double summand(double force, const SummationGrid &)
{
  return force;
}
FAULTGOUGE_INLINE Compensated summand(Compensated force, const SummationGrid &grid)
{
  return grid.round_to_grids(force);
}

template <bool FRICTION, class Number> FAULTGOUGE_INLINE void components(Batch<Number> &batch, const Grids grids)
{
  for (int k = 0; k < batch.count; k++) {
    const Number nx = batch.normal_x.load(k), ny = batch.normal_y.load(k), normal = batch.normal.load(k);
    Number x = normal * nx, y = normal * ny;
    if constexpr (FRICTION) {
      const Number tangential = batch.tangential.load(k);
      x = x - tangential * ny;
      y = y + tangential * nx;
      batch.tangential.store(k, summand(tangential, grids.tangential));
    }
    batch.force_x.store(k, summand(x, grids.force));
    batch.force_y.store(k, summand(y, grids.force));
  }
}

template <class P, class Number>
FAULTGOUGE_INLINE void evaluate(Batch<Number> &batch, const MindlinLaw &law, double dt, const Grids &grids,
                                Features features)
{
  normal_forces<P>(batch, law);
  if (!features.friction) {
    if (features.damped) add_dashpots<P, false, false>(batch, law, dt);
    return components<false>(batch, grids);
  }
  friction<P>(batch, law, features);
  if (features.damped && features.energy)
    add_dashpots<P, true, true>(batch, law, dt);
  else if (features.damped)
    add_dashpots<P, true, false>(batch, law, dt);
  components<true>(batch, grids);
}

// takes the contacts among the pairs from p on, until the batch is full; returns the pair to go on from
template <bool FRICTION, bool ADVANCE, bool DAMPED, class Number>
FAULTGOUGE_INLINE int fill_batch(Batch<Number> &batch, ContactPairs &pairs, int p, const Disks &disks,
                                 const Period &box, double dt, const Grids &grids)
{
  for (const int n = pairs.size(); p < n && batch.count < BATCH; p++) {
    const Branch<double> high = leading_branch(pairs, p, disks, box);
    const double rsq = high.x * high.x + high.y * high.y;
    const double reach =
        disks.radius[pairs.first[p]] + disks.radius[pairs.second[p]] + margin(Number(), grids.coordinate);
    if (rsq >= reach * reach) {
      open<Number, FRICTION>(pairs, p);
      continue;
    }
    Branch<Number> r{high.x, high.y};
    if constexpr (std::is_same_v<Number, Compensated>) {
      const Branch<double> low = low_branch(pairs, p, disks, box);
      r.x.low = low.x;
      r.y.low = low.y;
    }
    add<FRICTION, ADVANCE, DAMPED>(batch, pairs, p, r, disks, dt);
  }
  return p;
}

// puts the results where they belong; returns a pair with one centre inside of the other disk, or else what it is given
template <bool FRICTION, bool ENERGY, class Number>
FAULTGOUGE_INLINE int flush_batch(Batch<Number> &batch, ContactPairs &pairs, int owned, int crushed)
{
  for (int k = 0; k < batch.count; k++) {
    const int p = batch.pair[k];
    if (!(leading(batch.overlap.load(k)) <= std::min(batch.radius_i[k], batch.radius_j[k]))) crushed = p;
    if (leading(batch.overlap.load(k)) <= 0.0) {
      open<Number, FRICTION>(pairs, p);
      continue;
    }
    const Number tangential = FRICTION ? batch.tangential.load(k) : Number(0.0);
    store_force(pairs, p, owned, batch.force_x.load(k), batch.force_y.load(k), tangential);
    if constexpr (ENERGY) pairs.dissipated[p] = batch.dissipated[k] + (pairs.touching[p] ? pairs.dissipated[p] : 0.0);
    if constexpr (FRICTION) {
      pairs.touching[p] = 1;
      pairs.slip[p] = leading(batch.slip.load(k));
      if constexpr (std::is_same_v<Number, Compensated>) pairs.slip_low[p] = batch.slip.low[k];
    }
  }
  batch.count = 0;
  return crushed;
}

template <class Number>
FAULTGOUGE_INLINE int all_forces(ContactPairs &pairs, const Disks &disks, const Period &box, const MindlinLaw &law,
                                 double dt, Features features, const Grids &grids)
{
  features.advance = features.advance && features.friction;
  features.energy = features.energy && features.advance;
  const bool friction = features.friction, advance = features.advance, damped = features.damped;
  Batch<Number> batch;
  int crushed = -1;
  for (int p = 0, n = pairs.size(); p < n;) {
    p = advance    ? damped ? fill_batch<true, true, true>(batch, pairs, p, disks, box, dt, grids)
                            : fill_batch<true, true, false>(batch, pairs, p, disks, box, dt, grids)
        : friction ? damped ? fill_batch<true, false, true>(batch, pairs, p, disks, box, dt, grids)
                            : fill_batch<true, false, false>(batch, pairs, p, disks, box, dt, grids)
        : damped   ? fill_batch<false, false, true>(batch, pairs, p, disks, box, dt, grids)
                   : fill_batch<false, false, false>(batch, pairs, p, disks, box, dt, grids);
    Exponents::at(law.exponent,
                  [&](auto power) FAULTGOUGE_INLINED { evaluate<decltype(power)>(batch, law, dt, grids, features); });
    crushed = features.energy ? flush_batch<true, true>(batch, pairs, disks.owned, crushed)
              : friction      ? flush_batch<true, false>(batch, pairs, disks.owned, crushed)
                              : flush_batch<false, false>(batch, pairs, disks.owned, crushed);
  }
  return crushed;
}

}    // namespace faultgouge

#endif
