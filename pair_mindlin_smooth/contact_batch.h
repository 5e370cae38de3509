// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// One batch of contacts: the columns that the kernel works on, and the steps from branch vectors to forces. Each step
// is a loop without branches. No LAMMPS types. Included by contact_loop.h alone.

#ifndef FAULTGOUGE_CONTACT_BATCH_H
#define FAULTGOUGE_CONTACT_BATCH_H

#include "contact_kernel.h"

#include <cstring>
#include <type_traits>

namespace faultgouge {

// so many contacts that their columns stay in the first-level cache
constexpr int BATCH = 64;

// aligned so that no vector straddles two cache lines
struct alignas(64) DoubleColumn {
  double value[BATCH];
  FAULTGOUGE_INLINE double load(int k) const { return value[k]; }
  FAULTGOUGE_INLINE void store(int k, double number) { value[k] = number; }
};

struct alignas(64) CompensatedColumn {
  double high[BATCH], low[BATCH];
  FAULTGOUGE_INLINE Compensated load(int k) const { return {high[k], low[k]}; }
  FAULTGOUGE_INLINE void store(int k, Compensated number)
  {
    high[k] = number.high;
    low[k] = number.low;
  }
};

// Whether there is friction, and what becomes of slips
enum class Friction { NONE, LOOKED_AT, ADVANCED, RESCALED, SLIDER_LOOKED_AT, SLIDER };

// What is known at compile time
template <class NUMBER, class P, Friction SLIPS, bool HAS_DASHPOTS> struct Variant {
  using Number = NUMBER;
  static constexpr bool COMPENSATED = std::is_same_v<Number, Compensated>;
  using Power = P;
  static constexpr bool FRICTION = SLIPS != Friction::NONE, DAMPED = HAS_DASHPOTS;
  static constexpr bool SLIDER = SLIPS == Friction::SLIDER || SLIPS == Friction::SLIDER_LOOKED_AT;
  static constexpr bool ADVANCE = FRICTION && SLIPS != Friction::LOOKED_AT && SLIPS != Friction::SLIDER_LOOKED_AT;
  static constexpr bool RESCALE = P::EXPONENT > 1.0 && ADVANCE &&SLIPS != Friction::ADVANCED;
};

struct alignas(64) DashpotColumns {
  double rate_x[BATCH], rate_y[BATCH], rolling[BATCH];    // v_ij and R_i omega_i + R_j omega_j
};
struct NoDashpots {};

template <class V> struct Batch : std::conditional_t<V::DAMPED, DashpotColumns, NoDashpots> {
  using Column = std::conditional_t<V::COMPENSATED, CompensatedColumn, DoubleColumn>;

  int count = 0;
  int pair[BATCH];
  Column branch_x, branch_y, slip, overlap, normal, normal_x, normal_y, tangential, force_x, force_y;
  double radius_i[BATCH], radius_j[BATCH], moved_x[BATCH], moved_y[BATCH], rolled[BATCH];
  double dissipated[BATCH];    // in this step, only with energy
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

template <class V> FAULTGOUGE_INLINE void open(ContactPairs &pairs, int p)
{
  if constexpr (!V::COMPENSATED) pairs.force[p] = PairForce{};
  if constexpr (V::FRICTION) pairs.touching[p] = 0;
}

template <class V>
FAULTGOUGE_INLINE void add(Batch<V> &batch, const ContactPairs &pairs, int p, const Branch<typename V::Number> &r,
                           const Disks &disks, double dt)
{
  const int k = batch.count++, i = pairs.first[p], j = pairs.second[p];
  batch.pair[k] = p;
  batch.branch_x.store(k, r.x);
  batch.branch_y.store(k, r.y);
  batch.radius_i[k] = disks.radius[i];
  batch.radius_j[k] = disks.radius[j];
  if constexpr (V::DAMPED) {
    const double *const fi = disks.felt + 3 * i, *const fj = disks.felt + 3 * j;
    batch.rate_x[k] = fi[0] - fj[0];
    batch.rate_y[k] = fi[1] - fj[1];
    batch.rolling[k] = disks.radius[i] * fi[2] + disks.radius[j] * fj[2];
  }
  if constexpr (!V::FRICTION) return;

  const bool known = pairs.touching[p];
  if constexpr (V::COMPENSATED)
    batch.slip.store(k, known ? Compensated(pairs.slip[p], pairs.slip_low[p]) : Compensated());
  else
    batch.slip.store(k, known ? pairs.slip[p] : 0.0);
  if constexpr (V::ADVANCE) {
    const double *const vi = disks.v + 3 * i, *const vj = disks.v + 3 * j;
    const double step = known ? dt : 0.0;    // a new contact begins without slip
    batch.moved_x[k] = (vi[0] - vj[0]) * step;
    batch.moved_y[k] = (vi[1] - vj[1]) * step;
    batch.rolled[k] = (disks.radius[i] * disks.omega[3 * i + 2] + disks.radius[j] * disks.omega[3 * j + 2]) * step;
  }
}

// overlaps, directions and normal forces
template <class V> FAULTGOUGE_INLINE void normal_forces(Batch<V> &batch, const MindlinLaw law)
{
  using Number = typename V::Number;
  for (int k = 0; k < batch.count; k++) {
    const Branch<Number> r{batch.branch_x.load(k), batch.branch_y.load(k)};
    const Geometry<Number> contact = geometry(r, batch.radius_i[k], batch.radius_j[k]);
    const Number normal = law.normal_force<typename V::Power>(contact.overlap);
    batch.overlap.store(k, contact.overlap);
    batch.normal.store(k, normal);
    batch.normal_x.store(k, contact.direction(r.x));
    batch.normal_y.store(k, contact.direction(r.y));
  }
}

template <class V> FAULTGOUGE_INLINE double slip_increment(const Batch<V> &batch, int k)
{
  const Vector r{value(batch.branch_x.load(k)), value(batch.branch_y.load(k))};
  const Vector moved{batch.moved_x[k], batch.moved_y[k]};
  const double increment = midpoint_slip(r, moved) - batch.rolled[k];
  if constexpr (!V::RESCALE) return increment;
  return rescaled_increment<typename V::Power>(value(batch.slip.load(k)), increment, overlap_change(r, moved),
                                               value(batch.overlap.load(k)));
}

// slips, advanced if wanted, and tangential forces
template <class V> FAULTGOUGE_INLINE void tangential_forces(Batch<V> &batch, const MindlinLaw law)
{
  using Number = typename V::Number;
  const Number limit_ratio = law.slip_limit_ratio<Number>();
  // compensated operations wait for each other so long that increments are faster in a loop of their own
  constexpr bool APART = V::ADVANCE && V::COMPENSATED;
  double increment[BATCH];
  if constexpr (APART)
    for (int k = 0; k < batch.count; k++) increment[k] = slip_increment(batch, k);
  for (int k = 0; k < batch.count; k++) {
    const Number limit = limit_ratio * batch.overlap.load(k);
    Number slip = batch.slip.load(k);
    if constexpr (V::ADVANCE) slip = advanced_slip(slip, APART ? increment[k] : slip_increment(batch, k), limit);
    batch.slip.store(k, slip);
    batch.tangential.store(k, law.tangential_force<V::SLIDER>(batch.normal.load(k), slip, limit));
  }
}

// slips as they would be without a bound
template <class V> FAULTGOUGE_INLINE void unbounded_slips(Batch<V> &batch)
{
  for (int k = 0; k < batch.count; k++) batch.dissipated[k] = value(batch.slip.load(k)) + slip_increment(batch, k);
}

// by sliding, which is what the bound has taken from the slips
template <class V> FAULTGOUGE_INLINE void add_sliding(Batch<V> &batch)
{
  for (int k = 0; k < batch.count; k++)
    batch.dissipated[k] = (value(batch.slip.load(k)) - batch.dissipated[k]) * value(batch.tangential.load(k));
}

// after the elastic forces, since friction is bounded by the elastic normal force
template <class V, bool ENERGY> FAULTGOUGE_INLINE void add_dashpots(Batch<V> &batch, const MindlinLaw law, double dt)
{
  using Number = typename V::Number;
  for (int k = 0; k < batch.count; k++) {
    const double nx = value(batch.normal_x.load(k)), ny = value(batch.normal_y.load(k));
    const double overlap = value(batch.overlap.load(k)), rate_x = batch.rate_x[k], rate_y = batch.rate_y[k];
    const Number normal = batch.normal.load(k);
    const double opening = nx * rate_x + ny * rate_y;
    batch.normal.store(k, law.damped_normal<typename V::Power>(normal, overlap, opening));
    if constexpr (V::FRICTION) {
      const double slip_rate = (nx * rate_y - ny * rate_x) - batch.rolling[k];
      const Number elastic = batch.tangential.load(k);
      const Number sum = law.damped_tangential<typename V::Power>(elastic, normal, overlap, slip_rate);
      batch.tangential.store(k, sum);
      if constexpr (ENERGY)
        batch.dissipated[k] +=
            dt * law.dashpot_power<typename V::Power>(overlap, opening, slip_rate, value(elastic), value(sum));
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

template <class V> FAULTGOUGE_INLINE void components(Batch<V> &batch, const Grids grids)
{
  using Number = typename V::Number;
  for (int k = 0; k < batch.count; k++) {
    const Number nx = batch.normal_x.load(k), ny = batch.normal_y.load(k), normal = batch.normal.load(k);
    Number x = normal * nx, y = normal * ny;
    if constexpr (V::FRICTION) {
      const Number tangential = batch.tangential.load(k);
      x = x - tangential * ny;
      y = y + tangential * nx;
      batch.tangential.store(k, summand(tangential, grids.tangential));
    }
    batch.force_x.store(k, summand(x, grids.force));
    batch.force_y.store(k, summand(y, grids.force));
  }
}

template <class V>
FAULTGOUGE_INLINE void evaluate(Batch<V> &batch, const MindlinLaw law, double dt, const Grids &grids, bool energy)
{
  normal_forces(batch, law);
  if constexpr (V::ADVANCE)
    if (energy) unbounded_slips(batch);
  if constexpr (V::FRICTION) tangential_forces(batch, law);
  if constexpr (V::ADVANCE)
    if (energy) add_sliding(batch);
  if constexpr (V::DAMPED) {
    if (V::ADVANCE && energy)
      add_dashpots<V, true>(batch, law, dt);
    else
      add_dashpots<V, false>(batch, law, dt);
  }
  components(batch, grids);
}

}    // namespace faultgouge

#endif
