// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "contact_loop.h"

namespace faultgouge {

FAULTGOUGE_DISPATCH
int compensated_contact_forces(ContactPairs &pairs, const Disks &disks, const Period &box, const MindlinLaw &law,
                               double dt, Features features, const Grids &grids)
{
  return all_forces<Compensated>(pairs, disks, box, law, dt, features, grids);
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

}    // namespace faultgouge
