// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "pair_mindlin_smooth.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "update.h"

#include <algorithm>

using namespace LAMMPS_NS;
using faultgouge::Compensated;
using faultgouge::Disks;
using faultgouge::Features;
using faultgouge::leading;
using faultgouge::MindlinLaw;
using faultgouge::PairForce;
using faultgouge::Period;
using faultgouge::value;

void PairMindlinSmooth::rebuild_pairs()
{
  if (has_friction) {
    store_slips();
    history->check_owners();
  }
  pairs.build(*list, neighbor->skin, *atom, *domain, original, has_friction, compensated, energy);
}

void PairMindlinSmooth::load_slips()
{
  slips_in_fix = false;
  for (int p = 0; p < pairs.size(); p++) {
    const double *const slip = history->find(pairs.first[p], pairs.second_tag[p]);
    pairs.touching[p] = slip != nullptr;
    if (!slip) continue;
    pairs.slip[p] = slip[0];
    if (compensated) pairs.slip_low[p] = slip[1];
    if (energy) pairs.dissipated[p] = history->dissipated(slip);
  }
}

void PairMindlinSmooth::compute(int eflag, int vflag)
{
  ev_init(eflag, vflag);
  if (damped) sum_forces_on_owned();
  if (comm->nprocs > 1 && (compensated || damped || domain->xperiodic || domain->yperiodic)) communicate_originals();
  if (neighbor->ago == 0) rebuild_pairs();
  if (has_friction && slips_in_fix) load_slips();    // somebody may have written others

  // at setup the disks have not moved since the slips were last advanced
  const int crushed = contact_forces(!update->setupflag);
  if (crushed >= 0) stop_at_crushed_pair(crushed);

  const faultgouge::Forces forces{atom->f,         atom->torque,    compensated ? low_parts->array_atom : nullptr,
                                  FixLowParts::FX, FixLowParts::FY, FixLowParts::TORQUE};
  if (compensated)
    faultgouge::take_compensated_forces(pairs, disks(), forces);
  else
    faultgouge::sum_forces(pairs, disks(), forces);
  if (!evflag) return;
  if (compensated)
    tally<Compensated>();
  else
    tally<double>();
}

void PairMindlinSmooth::sum_forces_on_owned()
{
  felt.resize(FixDashpotVelocities::FELT * (atom->nlocal + atom->nghost));
  for (int i = 0; i < atom->nlocal; i++)
    std::copy_n(dashpots->array_atom[i], FixDashpotVelocities::FELT, &felt[FixDashpotVelocities::FELT * i]);
}

// and with them what else ghosts need
void PairMindlinSmooth::communicate_originals()
{
  original.resize(atom->nlocal + atom->nghost);
  for (int i = 0; i < atom->nlocal; i++) original[i] = {atom->x[i][0], atom->x[i][1]};
  if (compensated) {
    original_low.resize(original.size());
    for (int i = 0; i < atom->nlocal; i++) {
      const double *const low = low_parts->array_atom[i];
      original_low[i] = {low[FixLowParts::X], low[FixLowParts::Y]};
    }
  }
  comm->forward_comm(this);
}

int PairMindlinSmooth::pack_forward_comm(int n, int *list, double *buf, int /*pbc_flag*/, int * /*pbc*/)
{
  int m = 0;
  for (int k = 0; k < n; k++) {
    const int i = list[k];
    buf[m++] = original[i].x;
    buf[m++] = original[i].y;
    if (compensated) {
      buf[m++] = original_low[i].x;
      buf[m++] = original_low[i].y;
    }
    if (damped)
      for (int d = 0; d < FixDashpotVelocities::FELT; d++) buf[m++] = felt[FixDashpotVelocities::FELT * i + d];
  }
  return m;
}

void PairMindlinSmooth::unpack_forward_comm(int n, int first, double *buf)
{
  int m = 0;
  for (int i = first; i < first + n; i++) {
    original[i] = {buf[m], buf[m + 1]};
    m += 2;
    if (compensated) {
      original_low[i] = {buf[m], buf[m + 1]};
      m += 2;
    }
    if (damped)
      for (int d = 0; d < FixDashpotVelocities::FELT; d++) felt[FixDashpotVelocities::FELT * i + d] = buf[m++];
  }
}

Disks PairMindlinSmooth::disks() const
{
  return {atom->nlocal,         atom->x[0],      atom->v[0],
          atom->omega[0],       atom->radius,    compensated ? low_parts->array_atom[0] : nullptr,
          FixLowParts::COLUMNS, original.data(), original_low.data(),
          felt.data()};
}

Period PairMindlinSmooth::period() const
{
  if (!compensated) return {domain->prd[0], domain->prd[1], 0.0, 0.0};
  return {low_parts->period(0), low_parts->period(1), low_parts->period_low(0), low_parts->period_low(1)};
}

// Returns a pair with one centre inside of the other disk, or -1.
int PairMindlinSmooth::contact_forces(bool advance)
{
  const double dt = update->dt;
  const Features features{has_friction, advance, damped, law.history, energy};
  if (!compensated) return faultgouge::contact_forces(pairs, disks(), period(), law, dt, features);
  return faultgouge::compensated_contact_forces(pairs, disks(), period(), law, dt, features,
                                                {low_parts->grid(), force_grid, tangential_grid});
}

void PairMindlinSmooth::stop_at_crushed_pair(int p) const
{
  const auto r = faultgouge::leading_branch(pairs, p, disks(), period());
  const double distance = std::sqrt(r.x * r.x + r.y * r.y);
  if (distance == 0.0)
    error->one(FLERR, "Disks {} and {} have the same centre, so that their contact has no direction",
               pairs.first_tag[p], pairs.second_tag[p]);
  error->one(FLERR,
             "Disks {} and {} are only {} apart, the centre of one inside of the other, where the contact law does not "
             "hold: lower the load or the time step, or raise KN",
             pairs.first_tag[p], pairs.second_tag[p], distance);
}

// The energy is the elastic one of the normal force; the tangential force has none.
template <class NUMBER> void PairMindlinSmooth::tally()
{
  for (int p = 0; p < pairs.size(); p++) {
    const double energy = measure<NUMBER>(p, pairs.first[p]);
    if (energy == 0.0) continue;
    const double normal = svector[0], tangential = svector[1], nx = svector[4], ny = svector[5];
    const auto r = faultgouge::branch<NUMBER>(pairs, p, disks(), period());
    ev_tally_xyz(pairs.first[p], pairs.second[p], atom->nlocal, 0, energy, 0.0, normal * nx - tangential * ny,
                 normal * ny + tangential * nx, 0.0, value(r.x), value(r.y), 0.0);
  }
}

void PairMindlinSmooth::store_slips()
{
  if (slips_in_fix) return;
  slips_in_fix = true;
  const int owners = static_cast<int>(pairs.start.size()) - 1;
  for (int i = 0; i < owners; i++) {
    history->clear(i);
    for (int k = pairs.start[i]; k < pairs.start[i + 1]; k++) {
      const int p = pairs.row[k] >> 1;
      if (!pairs.touching[p]) continue;
      history->append(i, pairs.row[k] & 1 ? pairs.first_tag[p] : pairs.second_tag[p], pairs.slip[p],
                      compensated ? pairs.slip_low[p] : 0.0, energy ? pairs.dissipated[p] : 0.0);
    }
  }
}

// The contact as it stands: nothing is advanced and nothing is written.
double PairMindlinSmooth::single(int i, int j, int, int, double, double, double, double &fforce)
{
  std::fill(svector, svector + single_extra, 0.0);
  fforce = 0.0;
  const int p = i < atom->nlocal ? pair_of(i, j) : pair_of(j, i);
  if (p < 0) return 0.0;
  const double energy = compensated ? measure<Compensated>(p, i) : measure<double>(p, i);
  if (energy > 0.0) fforce = svector[0] / (atom->radius[i] + atom->radius[j] - svector[6]);
  return energy;
}

// the pair of an owned disk with another, or -1
int PairMindlinSmooth::pair_of(int i, int j) const
{
  if (i + 1 >= static_cast<int>(pairs.start.size())) return -1;
  for (int k = pairs.start[i]; k < pairs.start[i + 1]; k++) {
    const int p = pairs.row[k] >> 1;
    if ((pairs.row[k] & 1 ? pairs.first_tag[p] : pairs.second_tag[p]) == atom->tag[j]) return p;
  }
  return -1;
}

// what single() hands out, as seen from disk i; returns the energy, 0 where there is no contact
template <class NUMBER> double PairMindlinSmooth::measure(int p, int i)
{
  const auto r = faultgouge::branch<NUMBER>(pairs, p, disks(), period());
  const double radius_i = atom->radius[pairs.first[p]], radius_j = atom->radius[pairs.second[p]];
  const auto contact = geometry(r, radius_i, radius_j);
  if (leading(contact.overlap) <= 0.0) return 0.0;

  const double overlap = value(contact.overlap);
  const double sign = atom->tag[i] == pairs.first_tag[p] ? 1.0 : -1.0;
  svector[0] = law.normal_force(overlap);
  if (has_friction) {
    store_slips();
    const int owned = pairs.first[p];
    const double *stored = history->find(owned, pairs.second_tag[p]);
    const double limit = law.slip_limit_ratio<double>() * overlap;
    const double slip = stored ? *stored : 0.0;
    svector[1] = law.tangential_force(svector[0], slip, limit);
    svector[2] = slip;
    svector[3] = limit > 0.0 ? slip / limit : 0.0;
    if (stored && energy) svector[7] = history->dissipated(stored);
    if (stored && compensated) svector[8] = stored[1];
  }
  svector[4] = sign * value(contact.direction(r.x));
  svector[5] = sign * value(contact.direction(r.y));
  svector[6] = overlap;
  if (damped) add_dashpots<NUMBER>(p, r);
  return law.normal_energy(overlap);
}

// to the forces of single(): what the dashpots of a pair add
template <class NUMBER> void PairMindlinSmooth::add_dashpots(int p, const faultgouge::Branch<NUMBER> &r)
{
  const int i = pairs.first[p], j = pairs.second[p];
  const auto contact = geometry(r, atom->radius[i], atom->radius[j]);
  const double nx = value(contact.direction(r.x)), ny = value(contact.direction(r.y));
  const double *const fi = &felt[FixDashpotVelocities::FELT * i], *const fj = &felt[FixDashpotVelocities::FELT * j];
  const double vx = fi[0] - fj[0], vy = fi[1] - fj[1];
  const double elastic = svector[0], overlap = svector[6];
  svector[0] = law.damped_normal(elastic, overlap, nx * vx + ny * vy);
  if (!has_friction) return;
  const double slip_rate = (nx * vy - ny * vx) - (atom->radius[i] * fi[2] + atom->radius[j] * fj[2]);
  svector[1] = law.damped_tangential(svector[1], elastic, overlap, slip_rate);
}

double PairMindlinSmooth::memory_usage()
{
  const double force = compensated ? sizeof(double) : sizeof(PairForce);    // a low part of the slip, or a force
  const double per_pair = 3 * sizeof(int) + 2 * sizeof(tagint) + 2 + (energy ? 2 : 1) * sizeof(double) + force;
  const double per_disk = sizeof(int) + (compensated ? sizeof(faultgouge::CompensatedForce) : 0);
  return Pair::memory_usage() + pairs.size() * per_pair + pairs.row.size() * sizeof(int) +
         pairs.start.size() * per_disk;
}
