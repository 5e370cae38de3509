// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// The loop over the pairs, for one kind of numbers and all variants of the law. No LAMMPS types. Included by the files
// that compile it for doubles and in compensated arithmetic: each takes half of the time that the plugin takes to
// compile.

#ifndef FAULTGOUGE_CONTACT_LOOP_H
#define FAULTGOUGE_CONTACT_LOOP_H

#include "contact_batch.h"

#include <algorithm>

// Fused multiply-add makes exact products fast, and vectors of four or eight do the rest.
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__)
#define FAULTGOUGE_DISPATCH __attribute__((target_clones("avx512f", "fma", "default")))
#else
#define FAULTGOUGE_DISPATCH
#endif

namespace faultgouge {

// puts the results where they belong; returns a pair with one centre inside of the other disk, or else what it is given
template <class V>
FAULTGOUGE_INLINE int flush_batch(Batch<V> &batch, ContactPairs &pairs, int owned, int crushed, bool energy)
{
  using Number = typename V::Number;
  for (int k = 0; k < batch.count; k++) {
    const int p = batch.pair[k];
    if (!(leading(batch.overlap.load(k)) <= std::min(batch.radius_i[k], batch.radius_j[k]))) crushed = p;
    if (leading(batch.overlap.load(k)) <= 0.0) {
      open<V>(pairs, p);
      continue;
    }
    const Number tangential = V::FRICTION ? batch.tangential.load(k) : Number(0.0);
    store_force(pairs, p, owned, batch.force_x.load(k), batch.force_y.load(k), tangential);
    if constexpr (V::ADVANCE)
      if (energy) pairs.dissipated[p] = batch.dissipated[k] + (pairs.touching[p] ? pairs.dissipated[p] : 0.0);
    if constexpr (V::FRICTION) {
      pairs.touching[p] = 1;
      pairs.slip[p] = leading(batch.slip.load(k));
      if constexpr (V::COMPENSATED) pairs.slip_low[p] = batch.slip.low[k];
    }
  }
  batch.count = 0;
  return crushed;
}

// takes the contacts among the pairs from p on, until the batch is full; returns the pair to go on from
template <class V>
FAULTGOUGE_INLINE int fill_batch(Batch<V> &batch, ContactPairs &pairs, int p, const Disks &disks, const Period &box,
                                 double dt, const Grids &grids)
{
  using Number = typename V::Number;
  for (const int n = pairs.size(); p < n && batch.count < BATCH; p++) {
    const Branch<double> high = leading_branch(pairs, p, disks, box);
    const double rsq = high.x * high.x + high.y * high.y;
    const double reach =
        disks.radius[pairs.first[p]] + disks.radius[pairs.second[p]] + margin(Number(), grids.coordinate);
    if (rsq >= reach * reach) {
      open<V>(pairs, p);
      continue;
    }
    Branch<Number> r{high.x, high.y};
    if constexpr (V::COMPENSATED) {
      const Branch<double> low = low_branch(pairs, p, disks, box);
      r.x.low = low.x;
      r.y.low = low.y;
    }
    add(batch, pairs, p, r, disks, dt);
  }
  return p;
}

template <class V>
FAULTGOUGE_INLINE int all_forces(ContactPairs &pairs, const Disks &disks, const Period &box, const MindlinLaw &law,
                                 double dt, bool energy, const Grids &grids)
{
  Batch<V> batch;
  int crushed = -1;
  for (int p = 0, n = pairs.size(); p < n;) {
    p = fill_batch(batch, pairs, p, disks, box, dt, grids);
    evaluate(batch, law, dt, grids, energy);
    crushed = flush_batch(batch, pairs, disks.owned, crushed, energy);
  }
  return crushed;
}

template <class Number, class P, bool DAMPED, class... Rest>
FAULTGOUGE_INLINE int with_friction(Features features, ContactPairs &pairs, const Rest &...rest)
{
  if (!features.friction) return all_forces<Variant<Number, P, Friction::NONE, DAMPED>>(pairs, rest...);
  if (features.history == History::COULOMB)
    return features.advance ? all_forces<Variant<Number, P, Friction::SLIDER, DAMPED>>(pairs, rest...)
                            : all_forces<Variant<Number, P, Friction::SLIDER_LOOKED_AT, DAMPED>>(pairs, rest...);
  if (!features.advance) return all_forces<Variant<Number, P, Friction::LOOKED_AT, DAMPED>>(pairs, rest...);
  if constexpr (P::EXPONENT > 1.0)
    if (features.history == History::RESCALED)
      return all_forces<Variant<Number, P, Friction::RESCALED, DAMPED>>(pairs, rest...);
  return all_forces<Variant<Number, P, Friction::ADVANCED, DAMPED>>(pairs, rest...);
}

template <class Number>
FAULTGOUGE_INLINE int with_law(ContactPairs &pairs, const Disks &disks, const Period &box, const MindlinLaw &law,
                               double dt, Features features, const Grids &grids)
{
  const bool energy = features.energy;
  return Exponents::at(law.exponent, [&](auto p) FAULTGOUGE_INLINED {
    using P = decltype(p);
    return features.damped ? with_friction<Number, P, true>(features, pairs, disks, box, law, dt, energy, grids)
                           : with_friction<Number, P, false>(features, pairs, disks, box, law, dt, energy, grids);
  });
}

}    // namespace faultgouge

#endif
