#include "contact_kernel.h"

#include "contact_batch.h"

#include <algorithm>

// Fused multiply-add makes exact products fast, and vectors of four or eight do the rest.
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__)
#define FAULTGOUGE_DISPATCH __attribute__((target_clones("avx512f", "fma", "default")))
#else
#define FAULTGOUGE_DISPATCH
#endif

namespace faultgouge {

namespace {

// puts the results where they belong; returns a pair with one centre inside of the other disk, or else what it is given
template <class V>
FAULTGOUGE_INLINE int empty(Batch<V> &batch, ContactPairs &pairs, int owned, int crushed, bool energy)
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
    give_force(pairs, p, owned, batch.force_x.load(k), batch.force_y.load(k), tangential);
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

template <class V>
FAULTGOUGE_INLINE int all_forces(ContactPairs &pairs, const Disks &disks, const Period &box, const MindlinLaw &law,
                                 double dt, bool energy, const Grids &grids)
{
  using Number = typename V::Number;
  Batch<V> batch;
  int crushed = -1;
  for (int p = 0, n = pairs.size(); p < n; p++) {
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
    if (batch.count < BATCH) continue;
    evaluate(batch, law, dt, grids, energy);
    crushed = empty(batch, pairs, disks.owned, crushed, energy);
  }
  evaluate(batch, law, dt, grids, energy);
  return empty(batch, pairs, disks.owned, crushed, energy);
}

template <class Number, Exponent P, bool DAMPED, class... Rest>
FAULTGOUGE_INLINE int with_friction(Features features, ContactPairs &pairs, const Rest &...rest)
{
  if (!features.friction) return all_forces<Variant<Number, P, Friction::NONE, DAMPED>>(pairs, rest...);
  if (!features.advance) return all_forces<Variant<Number, P, Friction::LOOKED_AT, DAMPED>>(pairs, rest...);
  if constexpr (P == Exponent::HERTZ)
    if (features.rescaled) return all_forces<Variant<Number, P, Friction::RESCALED, DAMPED>>(pairs, rest...);
  return all_forces<Variant<Number, P, Friction::ADVANCED, DAMPED>>(pairs, rest...);
}

template <Exponent P, class Number>
FAULTGOUGE_INLINE FloorContact<Number> on_floor(const MindlinLaw &law, Number overlap, Number slip, double increment,
                                                const FloorRates &rates, Features features)
{
  const Number elastic = law.normal_force<P>(overlap);
  FloorContact<Number> contact{elastic, 0.0, slip, 0.0, 0.0, 0.0};
  if (features.damped) contact.normal = law.damped_normal<P>(elastic, value(overlap), rates.opening);
  if (!features.friction) return contact;
  contact.slip_limit = law.slip_limit_ratio<Number>() * overlap;
  if (features.advance) contact.slip = advanced_slip(slip, increment, contact.slip_limit);
  const Number friction = law.tangential_force(elastic, contact.slip, contact.slip_limit);
  contact.tangential = friction;
  if (features.damped) contact.tangential = law.damped_tangential<P>(friction, elastic, value(overlap), rates.slip);
  if (features.energy) {
    contact.slid = (value(contact.slip) - (value(slip) + increment)) * value(friction);
    if (features.damped)
      contact.dashpot_power =
          law.dashpot_power<P>(value(overlap), rates.opening, rates.slip, value(friction), value(contact.tangential));
  }
  return contact;
}

}    // namespace

FAULTGOUGE_DISPATCH
int contact_forces(ContactPairs &pairs, const Disks &disks, const Period &box, const MindlinLaw &law, double dt,
                   Features features)
{
  const Grids none{};
  if (law.exponent == Exponent::HARMONIC)
    return features.damped ? with_friction<double, Exponent::HARMONIC, true>(features, pairs, disks, box, law, dt,
                                                                             features.energy, none)
                           : with_friction<double, Exponent::HARMONIC, false>(features, pairs, disks, box, law, dt,
                                                                              features.energy, none);
  return features.damped
             ? with_friction<double, Exponent::HERTZ, true>(features, pairs, disks, box, law, dt, features.energy, none)
             : with_friction<double, Exponent::HERTZ, false>(features, pairs, disks, box, law, dt, features.energy,
                                                             none);
}

FAULTGOUGE_DISPATCH
int compensated_contact_forces(ContactPairs &pairs, const Disks &disks, const Period &box, const MindlinLaw &law,
                               double dt, Features features, const Grids &grids)
{
  if (law.exponent == Exponent::HARMONIC)
    return features.damped ? with_friction<Compensated, Exponent::HARMONIC, true>(features, pairs, disks, box, law, dt,
                                                                                  features.energy, grids)
                           : with_friction<Compensated, Exponent::HARMONIC, false>(features, pairs, disks, box, law, dt,
                                                                                   features.energy, grids);
  return features.damped ? with_friction<Compensated, Exponent::HERTZ, true>(features, pairs, disks, box, law, dt,
                                                                             features.energy, grids)
                         : with_friction<Compensated, Exponent::HERTZ, false>(features, pairs, disks, box, law, dt,
                                                                              features.energy, grids);
}

FAULTGOUGE_DISPATCH
void sum_forces(const ContactPairs &pairs, const Disks &disks, const Forces &forces)
{
  for (int i = 0; i < disks.owned; i++) {
    Four sum{}, more;
    for (int k = pairs.start[i]; k < pairs.start[i + 1]; k++) {
      load(more, pairs.force[pairs.row[k] >> 1]);
      sum += SIGN[pairs.row[k] & 1] * more;
    }
    forces.f[i][0] += sum[0];
    forces.f[i][1] += sum[1];
    forces.torque[i][2] -= disks.radius[i] * sum[2];
  }
}

FAULTGOUGE_DISPATCH
void take_compensated_forces(ContactPairs &pairs, const Disks &disks, const Forces &forces)
{
  for (int i = 0; i < disks.owned; i++) {
    auto &[high, low] = pairs.disk_force[i];
    const Compensated torque = -disks.radius[i] * Compensated(high.tangential, low.tangential);
    forces.f[i][0] += high.x;
    forces.f[i][1] += high.y;
    forces.torque[i][2] += torque.high;
    forces.low[i][forces.low_fx] = low.x;
    forces.low[i][forces.low_fy] = low.y;
    forces.low[i][forces.low_torque] = torque.low;
    pairs.disk_force[i] = CompensatedForce{};
  }
}

FAULTGOUGE_DISPATCH
FloorContact<double> floor_contact(const MindlinLaw &law, double overlap, double slip, double increment,
                                   const FloorRates &rates, Features features)
{
  if (law.exponent == Exponent::HARMONIC)
    return on_floor<Exponent::HARMONIC>(law, overlap, slip, increment, rates, features);
  return on_floor<Exponent::HERTZ>(law, overlap, slip, increment, rates, features);
}

FAULTGOUGE_DISPATCH
FloorContact<Compensated> floor_contact(const MindlinLaw &law, Compensated overlap, Compensated slip, double increment,
                                        const FloorRates &rates, Features features)
{
  if (law.exponent == Exponent::HARMONIC)
    return on_floor<Exponent::HARMONIC>(law, overlap, slip, increment, rates, features);
  return on_floor<Exponent::HERTZ>(law, overlap, slip, increment, rates, features);
}

}    // namespace faultgouge
