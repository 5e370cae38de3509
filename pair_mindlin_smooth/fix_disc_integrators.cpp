// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "fix_disc_integrators.h"

#include "atom.h"
#include "domain.h"
#include "error.h"
#include "fix_low_parts.h"
#include "modify.h"
#include "run_styles.h"
#include "update.h"

#include <algorithm>
#include <cmath>
#include <cstring>

using namespace LAMMPS_NS;
using namespace FixConst;

FixDiscIntegrator::FixDiscIntegrator(LAMMPS *lmp, int narg, char **arg, int numbers, bool takes_drag) :
    FixDiskColumns(lmp, narg, arg),
    numbers(numbers)
{
  static const char *const needs[] = {"no number", "one number, I0 = I/(m R^2)",
                                      "two numbers, GAMMA and I0 = I/(m R^2)"};
  if (narg < 3 + numbers) error->all(FLERR, "fix {} takes {}, but got {} arguments", style, needs[numbers], narg - 3);
  for (int k = 3 + numbers; k < narg; k++) {
    if (strcmp(arg[k], "compensated") == 0) {
      carries_low_parts = true;
    } else if (strcmp(arg[k], "rotation") == 0) {
      if (++k == narg) error->all(FLERR, "fix {}: rotation takes yes or no", style);
      rotation = utils::logical(FLERR, arg[k], false, lmp) == 1;
    } else if (takes_drag && strcmp(arg[k], "drag") == 0) {
      if (++k == narg) error->all(FLERR, "fix {}: drag takes a time, TAU", style);
      drag_time = positive_argument("TAU", arg[k]);
    } else {
      error->all(FLERR, "fix {} takes {} and the keywords {}rotation yes|no and compensated, but got {}", style,
                 needs[numbers], takes_drag ? "drag TAU, " : "", arg[k]);
    }
  }
  time_integrate = 1;
  dynamic_group_allow = 1;
  if (!atom->radius_flag || !atom->rmass_flag || !atom->omega_flag || !atom->torque_flag)
    error->all(FLERR, "fix {} needs disks with radius, mass and spin: use atom_style sphere", style);
}

double FixDiscIntegrator::positive_argument(const char *name, const char *text)
{
  const double value = utils::numeric(FLERR, text, false, lmp);
  if (!std::isfinite(value) || value <= 0.0)
    error->all(FLERR, "fix {}: {} must be a positive number, not {}", style, name, text);
  return value;
}

int FixDiscIntegrator::setmask()
{
  return INITIAL_INTEGRATE | (carries_low_parts ? FINAL_INTEGRATE : 0);
}

void FixDiscIntegrator::init()
{
  refuse_respa(*this, *update, *error);
  if (domain->dimension != 2) error->all(FLERR, "fix {} is for disks in the plane: use dimension 2", style);
  for (int i = 0; i < atom->nlocal; i++)
    if ((atom->mask[i] & groupbit) && !(atom->radius[i] > 0.0 && atom->rmass[i] > 0.0))
      error->one(FLERR, "fix {}: disk {} has radius {} and mass {}, but both must be positive", style, atom->tag[i],
                 atom->radius[i], atom->rmass[i]);
  int is_double, columns;
  angle = atom->find_custom("theta", is_double, columns);
  if (!is_double || columns > 0) angle = -1;
  low_parts = nullptr;
  if (carries_low_parts) {
    low_parts = dynamic_cast<FixLowParts *>(modify->get_fix_by_id(FixLowParts::ID));
    if (!low_parts)
      error->all(FLERR, "fix {} with the keyword compensated needs pair_style mindlin/smooth KN KT MU compensated",
                 style);
  }
  reset_dt();
}

// after all that act on the disks: this fix comes last
void FixDiscIntegrator::setup(int /*vflag*/)
{
  complete_forces();
}

void FixDiscIntegrator::final_integrate()
{
  complete_forces();
}

void FixDiscIntegrator::complete_forces()
{
  if (!low_parts) return;
  for (int i = 0; i < atom->nlocal; i++) low_parts->complete_force(i);
}

void FixDiscIntegrator::wrap()
{
  if (low_parts)
    low_parts->setup_pre_exchange();
  else
    domain->pbc();
}

void FixDiscIntegrator::reset_dt()
{
  dt = update->dt;
}

FixDiscIntegrator::Disks FixDiscIntegrator::disks() const
{
  const auto rows = [](double **array) { return reinterpret_cast<Disks::Row *>(array[0]); };
  const int count = atom->nlocal;
  if (count == 0) return {};
  return {dt,          count,        rows(atom->x), rows(atom->v), rows(atom->f), rows(atom->omega), rows(atom->torque),
          atom->rmass, atom->radius, atom->mask,    angles()};
}

template <bool ROTATION>
FAULTGOUGE_INLINE void FixDiscIntegrator::Disks::set_velocity(int i, const Velocity &velocity) const
{
  v[i][0] = velocity.x;
  v[i][1] = velocity.y;
  if constexpr (ROTATION) omega[i][2] = velocity.spin;
}

template <bool ROTATION, bool COMPENSATED>
FAULTGOUGE_INLINE void FixDiscIntegrator::move(const Disks &disks, int i, const Velocity &velocity)
{
  const double dx = disks.dt * velocity.x, dy = disks.dt * velocity.y, radius = disks.radius[i];
  if (!(dx * dx + dy * dy <= radius * radius)) stop_at_long_step(i, dx, dy);
  if constexpr (COMPENSATED) {
    low_parts->move(i, dx, dy);
  } else {
    disks.x[i][0] += dx;
    disks.x[i][1] += dy;
  }
  if constexpr (ROTATION)
    if (disks.theta) disks.theta[i] += disks.dt * velocity.spin;
}

double *FixDiscIntegrator::angles() const
{
  return angle >= 0 ? atom->dvector[angle] : nullptr;
}

void FixDiscIntegrator::stop_at_long_step(int i, double dx, double dy) const
{
  error->one(
      FLERR,
      "fix {}: disk {} would move by ({}, {}) in one step, farther than its radius {}: the time step is too long, "
      "or a force too large",
      style, atom->tag[i], dx, dy, atom->radius[i]);
}

FixNVEDisc::FixNVEDisc(LAMMPS *lmp, int narg, char **arg) : FixDiscIntegrator(lmp, narg, arg, 1, true)
{
  inertia_factor = positive_argument("I0", arg[3]);
}

int FixNVEDisc::setmask()
{
  return INITIAL_INTEGRATE | FINAL_INTEGRATE;
}

// Divisions are half of what a step costs, and less in batches, which are vector instructions. Velocities stay in
// registers from one part of a step to the next.
template <bool ROTATION, class Work>
FAULTGOUGE_INLINE void FixNVEDisc::for_each_disk(const Disks &disks, Work work) const
{
  constexpr int BATCH = 64;
  double per_mass[BATCH], per_inertia[BATCH];
  const int group = groupbit;
  const double half_step = 0.5 * dt, factor = inertia_factor;
  for (int first = 0; first < disks.count; first += BATCH) {
    const int count = std::min(BATCH, disks.count - first);
    for (int k = 0; k < count; k++) {
      const double radius = disks.radius[first + k];
      per_mass[k] = half_step / disks.mass[first + k];
      if constexpr (ROTATION) per_inertia[k] = per_mass[k] / (factor * radius * radius);
    }
    for (int k = 0, i = first; k < count; k++, i++) {
      if (!(disks.mask[i] & group)) continue;
      const auto kick = [&](Velocity &velocity) {
        velocity.x += per_mass[k] * disks.f[i][0];
        velocity.y += per_mass[k] * disks.f[i][1];
        if constexpr (ROTATION) velocity.spin += per_inertia[k] * disks.torque[i][2];
      };
      work(i, Velocity{disks.v[i][0], disks.v[i][1], ROTATION ? disks.omega[i][2] : 0.0}, kick);
    }
  }
}

void FixNVEDisc::reset_dt()
{
  FixDiscIntegrator::reset_dt();
  // exp needs the glibc of 2019; expm1 is older, and loses nothing for steps that are short against drag_time
  kept = drag_time > 0.0 ? 1.0 + std::expm1(-0.5 * dt / drag_time) : 1.0;
}

FAULTGOUGE_INLINE void FixNVEDisc::decay(Velocity &velocity, double kept)
{
  velocity.x *= kept;
  velocity.y *= kept;
  velocity.spin *= kept;
}

template <class Work> void FixNVEDisc::dispatch_with_drag(Work work) const
{
  dispatch([this, work](auto rotates, auto compensates) {
    if (drag_time > 0.0)
      work(rotates, compensates, std::true_type());
    else
      work(rotates, compensates, std::false_type());
  });
}

void FixNVEDisc::initial_integrate(int /*vflag*/)
{
  dispatch_with_drag([this](auto rotates, auto compensates, auto drags) {
    constexpr bool ROTATION = decltype(rotates)::value;
    const Disks all = disks();
    const double drag = kept;
    for_each_disk<ROTATION>(all, [&](int i, Velocity velocity, auto kick) {
      if constexpr (decltype(drags)::value) decay(velocity, drag);
      kick(velocity);
      all.set_velocity<ROTATION>(i, velocity);
      move<ROTATION, decltype(compensates)::value>(all, i, velocity);
    });
  });
}

void FixNVEDisc::final_integrate()
{
  complete_forces();
  dispatch_with_drag([this](auto rotates, auto /*compensates*/, auto drags) {
    constexpr bool ROTATION = decltype(rotates)::value;
    const Disks all = disks();
    const double drag = kept;
    for_each_disk<ROTATION>(all, [&](int i, Velocity velocity, auto kick) {
      kick(velocity);
      if constexpr (decltype(drags)::value) decay(velocity, drag);
      all.set_velocity<ROTATION>(i, velocity);
    });
  });
}

FixDisplaceDisc::FixDisplaceDisc(LAMMPS *lmp, int narg, char **arg) : FixDiscIntegrator(lmp, narg, arg, 0)
{
  make_columns(COLUMNS);
}

int FixDisplaceDisc::setmask()
{
  return FixDiscIntegrator::setmask() | POST_RUN;
}

void FixDisplaceDisc::init()
{
  FixDiscIntegrator::init();
  read_given_state();
}

bool FixDisplaceDisc::read_given_state()
{
  bool given = false;
  double *const theta = angles();
  for (int i = 0; i < atom->nlocal; i++) {
    double *const state = array_atom[i];
    if (state[GIVEN] == 0.0) continue;
    state[GIVEN] = 0.0;
    given = true;
    atom->x[i][0] = state[X];
    atom->x[i][1] = state[Y];
    atom->v[i][0] = state[VX];
    atom->v[i][1] = state[VY];
    atom->omega[i][2] = state[OMEGA];
    if (theta) theta[i] = state[THETA];
  }
  return given;
}

void FixDisplaceDisc::post_run()
{
  const double *const theta = angles();
  for (int i = 0; i < atom->nlocal; i++) {
    const double *const x = atom->x[i], *const v = atom->v[i], *const f = atom->f[i];
    const double state[] = {
        0.0, x[0], x[1], theta ? theta[i] : 0.0, v[0], v[1], atom->omega[i][2], f[0], f[1], atom->torque[i][2]};
    static_assert(sizeof(state) == COLUMNS * sizeof(double), "a number for each column");
    std::copy(state, state + COLUMNS, array_atom[i]);
  }
}

// Disks are wrapped into the box before and after, and not when neighbour lists happen to be built: what comes out
// depends on what was given alone, with or without a setup in between.
void FixDisplaceDisc::initial_integrate(int /*vflag*/)
{
  if (read_given_state()) wrap();
  dispatch([this](auto rotates, auto compensates) {
    const Disks all = disks();
    for (int i = 0; i < all.count; i++)
      if (all.mask[i] & groupbit)
        move<decltype(rotates)::value, decltype(compensates)::value>(
            all, i, {all.v[i][0], all.v[i][1], decltype(rotates)::value ? all.omega[i][2] : 0.0});
  });
  wrap();
}

FixOverdampedDisc::FixOverdampedDisc(LAMMPS *lmp, int narg, char **arg) : FixDiscIntegrator(lmp, narg, arg, 2)
{
  damping = positive_argument("GAMMA", arg[3]);
  inertia_factor = positive_argument("I0", arg[4]);
}

void FixOverdampedDisc::initial_integrate(int /*vflag*/)
{
  dispatch([this](auto rotates, auto compensates) {
    const Disks all = disks();
    for (int i = 0; i < all.count; i++) {
      if (!(all.mask[i] & groupbit)) continue;
      Velocity velocity{all.f[i][0] / damping, all.f[i][1] / damping, 0.0};
      if constexpr (decltype(rotates)::value) {
        const double radius = all.radius[i];
        velocity.spin = all.torque[i][2] / (damping * inertia_factor * radius * radius);
      }
      all.set_velocity<decltype(rotates)::value>(i, velocity);
      move<decltype(rotates)::value, decltype(compensates)::value>(all, i, velocity);
    }
  });
}
