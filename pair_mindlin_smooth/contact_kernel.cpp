// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "contact_loop.h"

namespace faultgouge {

namespace {

template <class P, class Number>
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
  return all_forces<double>(pairs, disks, box, law, dt, features, Grids{});
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
FloorContact<double> floor_contact(const MindlinLaw &law, double overlap, double slip, double increment,
                                   const FloorRates &rates, Features features)
{
  return Exponents::at(law.exponent, [&](auto p) FAULTGOUGE_INLINED {
    return on_floor<decltype(p)>(law, overlap, slip, increment, rates, features);
  });
}

FAULTGOUGE_DISPATCH
FloorContact<Compensated> floor_contact(const MindlinLaw &law, Compensated overlap, Compensated slip, double increment,
                                        const FloorRates &rates, Features features)
{
  return Exponents::at(law.exponent, [&](auto p) FAULTGOUGE_INLINED {
    return on_floor<decltype(p)>(law, overlap, slip, increment, rates, features);
  });
}

}    // namespace faultgouge
