// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "fix_weaken_friction.h"

#include "atom.h"
#include "comm.h"
#include "compute_layer_velocity.h"
#include "error.h"
#include "fix_wall_mindlin_smooth.h"
#include "force.h"
#include "modify.h"
#include "pair.h"
#include "run_styles.h"

#include <cmath>
#include <cstring>

using namespace LAMMPS_NS;
using namespace FixConst;

FixWeakenFriction::FixWeakenFriction(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
  if (narg != 9)
    error->all(FLERR, "fix {} takes six numbers, MU B W MU_SS V0 V_SS, but got {} arguments", style, narg - 3);
  double *const wanted[] = {&mu, &b, &w, &mu_ss, &v0, &v_ss};
  for (int k = 0; k < 6; k++) {
    *wanted[k] = utils::numeric(FLERR, arg[3 + k], false, lmp);
    if (!std::isfinite(*wanted[k]) || *wanted[k] < 0.0)
      error->all(FLERR, "fix {}: MU B W MU_SS V0 V_SS must be finite and not negative, but one is {}", style,
                 arg[3 + k]);
  }
  if (mu == 0.0 || v_ss == 0.0)
    error->all(FLERR, "fix {}: MU and V_SS must be above 0, but are {} and {}", style, mu, v_ss);
  scalar_flag = vector_flag = 1;
  size_vector = 1;
  extscalar = extvector = 0;
  global_freq = 1;
  restart_global = 1;
  dynamic_group_allow = 1;
}

int FixWeakenFriction::setmask()
{
  return PRE_FORCE | POST_RUN;
}

void FixWeakenFriction::init()
{
  refuse_respa(*this, *update, *error);
  if (update->whichflag == 2) error->all(FLERR, "fix {}: a minimizer has no velocities: unfix {} before", style, id);
  int dim;
  Pair *const pair = force->pair_match("mindlin/smooth", 1);
  if (!pair) error->all(FLERR, "fix {} needs pair_style mindlin/smooth, whose friction weakens", style);
  of_pair = static_cast<double *>(pair->extract("mu", dim));
  if (*static_cast<double *>(pair->extract("kt", dim)) == 0.0)
    error->all(FLERR, "fix {}: pair_style mindlin/smooth has KT = 0 and no friction that weakens", style);
  floors.clear();
  int others = 0;
  for (const auto &fix : modify->get_fix_list()) {
    if (auto *const floor = dynamic_cast<FixWallMindlinSmooth *>(fix)) floors.push_back(floor);
    others += dynamic_cast<FixWeakenFriction *>(fix) != nullptr;
  }
  if (others > 1)
    error->all(FLERR, "fix {} sets the friction of all contacts: define it once, not {} times", style, others);
}

double FixWeakenFriction::mean() const
{
  return mean_velocity(*atom, groupbit, world, comm->nprocs);
}

double FixWeakenFriction::friction(double velocity) const
{
  const double speed = std::fabs(velocity);
  if (!(speed > v0)) return mu;
  // exp in doubles needs the glibc of 2019
  return mu * (b * static_cast<double>(std::exp(static_cast<long double>(-w * (speed - v0) / v_ss))) + mu_ss);
}

void FixWeakenFriction::set_velocity(double velocity)
{
  friction_velocity = velocity;
  const double now = friction(velocity);
  for (const auto &floor : floors) floor->change_mu(now);
  if (now == *of_pair) return;
  *of_pair = now;
  force->pair_match("mindlin/smooth", 1)->reinit();
}

void FixWeakenFriction::setup_pre_force(int /*vflag*/)
{
  const double velocity = mean();
  set_velocity(has_last && velocity == last ? friction_velocity : velocity);
}

void FixWeakenFriction::pre_force(int /*vflag*/)
{
  set_velocity(mean());
}

void FixWeakenFriction::post_run()
{
  last = mean();
  has_last = true;
}

void FixWeakenFriction::write_restart(FILE *fp)
{
  const double state[] = {friction_velocity, mean()};
  if (comm->me != 0) return;
  const int size = sizeof(state);
  fwrite(&size, sizeof(size), 1, fp);
  fwrite(state, sizeof(double), 2, fp);
}

void FixWeakenFriction::restart(char *stored)
{
  std::memcpy(&friction_velocity, stored, sizeof(double));
  std::memcpy(&last, stored + sizeof(double), sizeof(double));
  has_last = true;
}

double FixWeakenFriction::compute_scalar()
{
  return friction(mean());
}

double FixWeakenFriction::compute_vector(int)
{
  return mean();
}

bool LAMMPS_NS::friction_weakens(Modify &modify)
{
  for (const auto &fix : modify.get_fix_list())
    if (dynamic_cast<const FixWeakenFriction *>(fix)) return true;
  return false;
}
