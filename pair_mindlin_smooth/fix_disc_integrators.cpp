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
  for (int i = 0; i < atom->nlocal; i++) complete_force<true>(i);
}

void FixDiscIntegrator::wrap()
{
  if (low_parts)
    low_parts->setup_pre_exchange();
  else
    domain->pbc();
}

template <bool COMPENSATED> FAULTGOUGE_INLINE void FixDiscIntegrator::complete_force(int i)
{
  if constexpr (COMPENSATED) low_parts->complete_force(i);
}

void FixDiscIntegrator::reset_dt()
{
  dt = update->dt;
}

template <bool ROTATION, bool COMPENSATED> FAULTGOUGE_INLINE void FixDiscIntegrator::move(int i)
{
  const double dx = dt * atom->v[i][0], dy = dt * atom->v[i][1];
  if (!(dx * dx + dy * dy <= atom->radius[i] * atom->radius[i])) refuse(i, dx, dy);
  if constexpr (COMPENSATED) {
    low_parts->move(i, dx, dy);
  } else {
    atom->x[i][0] += dx;
    atom->x[i][1] += dy;
  }
  if constexpr (ROTATION)
    if (angle >= 0) atom->dvector[angle][i] += dt * atom->omega[i][2];
}

double *FixDiscIntegrator::angles() const
{
  return angle >= 0 ? atom->dvector[angle] : nullptr;
}

void FixDiscIntegrator::refuse(int i, double dx, double dy) const
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

template <bool ROTATION> FAULTGOUGE_INLINE void FixNVEDisc::kick(int i)
{
  const double per_mass = 0.5 * dt / atom->rmass[i];
  atom->v[i][0] += per_mass * atom->f[i][0];
  atom->v[i][1] += per_mass * atom->f[i][1];
  if constexpr (ROTATION) {
    const double radius = atom->radius[i];
    atom->omega[i][2] += per_mass / (inertia_factor * radius * radius) * atom->torque[i][2];
  }
}

void FixNVEDisc::reset_dt()
{
  FixDiscIntegrator::reset_dt();
  // exp needs the glibc of 2019; expm1 is older, and loses nothing for steps that are short against drag_time
  kept = drag_time > 0.0 ? 1.0 + std::expm1(-0.5 * dt / drag_time) : 1.0;
}

template <bool ROTATION> FAULTGOUGE_INLINE void FixNVEDisc::decay(int i)
{
  atom->v[i][0] *= kept;
  atom->v[i][1] *= kept;
  if constexpr (ROTATION) atom->omega[i][2] *= kept;
}

template <class Work> void FixNVEDisc::choose_all(Work work) const
{
  choose([this, work](auto rotates, auto compensates) {
    if (drag_time > 0.0)
      work(rotates, compensates, std::true_type());
    else
      work(rotates, compensates, std::false_type());
  });
}

void FixNVEDisc::initial_integrate(int /*vflag*/)
{
  choose_all([this](auto rotates, auto compensates, auto drags) {
    for (int i = 0; i < atom->nlocal; i++)
      if (atom->mask[i] & groupbit) {
        if constexpr (decltype(drags)::value) decay<decltype(rotates)::value>(i);
        kick<decltype(rotates)::value>(i);
        move<decltype(rotates)::value, decltype(compensates)::value>(i);
      }
  });
}

void FixNVEDisc::final_integrate()
{
  choose_all([this](auto rotates, auto compensates, auto drags) {
    for (int i = 0; i < atom->nlocal; i++) {
      complete_force<decltype(compensates)::value>(i);
      if (!(atom->mask[i] & groupbit)) continue;
      kick<decltype(rotates)::value>(i);
      if constexpr (decltype(drags)::value) decay<decltype(rotates)::value>(i);
    }
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
  take_given();
}

bool FixDisplaceDisc::take_given()
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
  if (take_given()) wrap();
  choose([this](auto rotates, auto compensates) {
    for (int i = 0; i < atom->nlocal; i++)
      if (atom->mask[i] & groupbit) move<decltype(rotates)::value, decltype(compensates)::value>(i);
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
  choose([this](auto rotates, auto compensates) {
    for (int i = 0; i < atom->nlocal; i++) {
      if (!(atom->mask[i] & groupbit)) continue;
      atom->v[i][0] = atom->f[i][0] / damping;
      atom->v[i][1] = atom->f[i][1] / damping;
      if constexpr (decltype(rotates)::value) {
        const double radius = atom->radius[i];
        atom->omega[i][2] = atom->torque[i][2] / (damping * inertia_factor * radius * radius);
      }
      move<decltype(rotates)::value, decltype(compensates)::value>(i);
    }
  });
}
