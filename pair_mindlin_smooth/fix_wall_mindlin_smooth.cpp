// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "fix_wall_mindlin_smooth.h"

#include "atom.h"
#include "contact_kernel.h"
#include "domain.h"
#include "error.h"
#include "fix_dashpot_velocities.h"
#include "fix_low_parts.h"
#include "fix_weaken_friction.h"
#include "force.h"
#include "input.h"
#include "law_keywords.h"
#include "modify.h"
#include "run_styles.h"
#include "update.h"
#include "variable.h"

#include <algorithm>
#include <cstring>
#include <type_traits>

using namespace LAMMPS_NS;
using namespace FixConst;
using faultgouge::Compensated;
using faultgouge::exact_sum;
using faultgouge::leading;
using faultgouge::MindlinLaw;
using faultgouge::value;

namespace {

constexpr const char *COMMAND = "fix wall/mindlin/smooth";

}    // namespace

FixWallMindlinSmooth::FixWallMindlinSmooth(LAMMPS *lmp, int narg, char **arg) : FixDiskColumns(lmp, narg, arg)
{
  if (narg < 8)
    error->all(FLERR, "fix wall/mindlin/smooth takes KN KT MU ylo COORD and keywords, but got {} arguments", narg - 3);
  law.kn = utils::numeric(FLERR, arg[3], false, lmp);
  law.kt = utils::numeric(FLERR, arg[4], false, lmp);
  set_mu(arg[5]);
  if (!law.valid())
    error->all(FLERR, "fix wall/mindlin/smooth: KN must be positive, KT and MU not negative, all finite (got {} {} {})",
               arg[3], arg[4], arg[5]);
  if (strcmp(arg[6], "ylo") != 0)
    error->all(FLERR, "fix wall/mindlin/smooth knows a floor only: use ylo COORD instead of {}", arg[6]);
  height = utils::numeric(FLERR, arg[7], false, lmp);
  if (!std::isfinite(height)) error->all(FLERR, "fix wall/mindlin/smooth: ylo must be finite, not {}", arg[7]);
  const LawKeywords keywords = LawReader(lmp, COMMAND, law).read(8, narg, arg);
  compensated = keywords.compensated;
  damping = keywords.damping;
  dissipating = keywords.energy;

  if (!atom->radius_flag || !atom->omega_flag || !atom->torque_flag)
    error->all(FLERR, "fix wall/mindlin/smooth needs disks with radius and spin: use atom_style sphere");

  scalar_flag = 1;
  global_freq = 1;
  extscalar = 1;
  energy_global_flag = 1;
  make_columns(OVERLAP + 1 + compensated + dissipating);
}

int FixWallMindlinSmooth::setmask()
{
  return POST_FORCE | MIN_POST_FORCE;
}

void FixWallMindlinSmooth::init()
{
  refuse_respa(*this, *update, *error);
  if (domain->dimension != 2) error->all(FLERR, "fix wall/mindlin/smooth is for disks in the plane: use dimension 2");
  if (domain->periodicity[1])
    error->all(FLERR, "fix wall/mindlin/smooth needs a box that is not periodic in y: use boundary p f p");
  low_parts = dynamic_cast<FixLowParts *>(modify->get_fix_by_id(FixLowParts::ID));
  if (force->pair_match("mindlin/smooth", 1) && compensated != (low_parts != nullptr))
    error->all(FLERR,
               "fix wall/mindlin/smooth and pair mindlin/smooth must both have the keyword compensated, or neither");
  if (compensated && !low_parts)
    error->all(FLERR, "fix wall/mindlin/smooth with the keyword compensated needs pair_style mindlin/smooth KN KT MU "
                      "compensated");
  find_dashpots();
  if (!mu_variable.empty()) {
    mu_index = input->variable->find(mu_variable.c_str());
    if (mu_index < 0 || !input->variable->equalstyle(mu_index))
      error->all(FLERR, "fix wall/mindlin/smooth: MU is v_{}, but there is no equal-style variable of that name",
                 mu_variable);
  }
  // friction that changes may be zero now and not later
  has_friction = mu_variable.empty() && !friction_weakens(*modify) ? law.frictional() : law.kt > 0.0;
  if (has_friction && reruns(*update))
    error->all(FLERR, "fix wall/mindlin/smooth with friction cannot serve rerun, since snapshots have no slips: rerun "
                      "with MU = 0");
  if (has_friction && update->whichflag == 2)
    error->all(FLERR, "fix wall/mindlin/smooth with friction cannot be minimized, since its forces depend on the path: "
                      "relax with fix overdamped/disc, or minimize with mu = 0");
}

// the pair style has made fix dashpot/velocities when fixes are initialized
void FixWallMindlinSmooth::find_dashpots()
{
  damped = damping && !displaces_disks(*modify);
  dashpots = dynamic_cast<FixDashpotVelocities *>(modify->get_fix_by_id(FixDashpotVelocities::ID));
  if (damped && !dashpots)
    error->all(FLERR,
               "fix wall/mindlin/smooth with the keyword damping needs pair_style mindlin/smooth KN KT MU damping "
               "CN CT (0 0 for none between disks)");
}

void FixWallMindlinSmooth::setup(int vflag)
{
  post_force(vflag);
}

void FixWallMindlinSmooth::min_setup(int vflag)
{
  post_force(vflag);
}

void FixWallMindlinSmooth::min_post_force(int vflag)
{
  post_force(vflag);
}

void FixWallMindlinSmooth::set_mu(const char *text)
{
  mu_index = -1;
  mu_variable = utils::strmatch(text, "^v_") ? text + 2 : "";
  law.mu = mu_variable.empty() ? utils::numeric(FLERR, text, false, lmp) : 0.0;
}

int FixWallMindlinSmooth::modify_param(int narg, char **arg)
{
  if (strcmp(arg[0], "damping") == 0) {
    if (narg > 1 && strcmp(arg[1], "no") == 0) {
      damping = false;
      law.cn = law.ct = 0.0;
      return 2;
    }
    if (narg < 3) error->all(FLERR, "fix_modify {} damping takes two numbers, CN CT, or no", id);
    LawReader(lmp, COMMAND, law).read_dashpots(arg[1], arg[2]);
    damping = true;
    return 3;
  }
  if (strcmp(arg[0], "mu") != 0) return 0;
  if (narg < 2) error->all(FLERR, "fix_modify {} mu takes a number or a variable v_NAME", id);
  set_mu(arg[1]);
  if (!law.valid()) error->all(FLERR, "fix_modify {} mu: must not be negative, but is {}", id, arg[1]);
  return 2;
}

void FixWallMindlinSmooth::change_mu(double mu)
{
  if (!mu_variable.empty())
    error->all(FLERR,
               "fix wall/mindlin/smooth: MU is v_{}, and fix weaken/friction sets it too: leave one of the two out",
               mu_variable);
  law.mu = mu;
}

void FixWallMindlinSmooth::update_mu()
{
  modify->clearstep_compute();
  law.mu = input->variable->compute_equal(mu_index);
  modify->addstep_compute(update->ntimestep + 1);
  if (!law.valid()) error->all(FLERR, "fix wall/mindlin/smooth: MU became {} in v_{}", law.mu, mu_variable);
}

void FixWallMindlinSmooth::post_force(int /*vflag*/)
{
  if (mu_index >= 0) update_mu();
  if (compensated)
    choose_friction<Compensated>();
  else
    choose_friction<double>();
}

template <class NUMBER> void FixWallMindlinSmooth::choose_friction()
{
  if (damped)
    has_friction ? contact_forces<NUMBER, true, true>() : contact_forces<NUMBER, false, true>();
  else
    has_friction ? contact_forces<NUMBER, true, false>() : contact_forces<NUMBER, false, false>();
}

template <> double FixWallMindlinSmooth::overlap_of<double>(int i) const
{
  return atom->radius[i] - (atom->x[i][1] - height);
}

template <> Compensated FixWallMindlinSmooth::overlap_of<Compensated>(int i) const
{
  const Compensated above = exact_sum(atom->radius[i], -atom->x[i][1]) + Compensated(height);
  return normalized(above - Compensated(low_parts->array_atom[i][FixLowParts::Y]));
}

template <> void FixWallMindlinSmooth::add_force(int i, double x, double y, double torque)
{
  atom->f[i][0] += x;
  atom->f[i][1] += y;
  atom->torque[i][2] += torque;
}

template <> void FixWallMindlinSmooth::add_force(int i, Compensated x, Compensated y, Compensated torque)
{
  double *const low = low_parts->array_atom[i];
  const auto add = [](double &sum, double &sum_low, Compensated force) {
    const Compensated total = Compensated(sum, sum_low) + force;
    sum = total.high;
    sum_low = total.low;
  };
  add(atom->f[i][0], low[FixLowParts::FX], x);
  add(atom->f[i][1], low[FixLowParts::FY], y);
  add(atom->torque[i][2], low[FixLowParts::TORQUE], torque);
}

template <class NUMBER, bool FRICTION, bool DAMPED> void FixWallMindlinSmooth::contact_forces()
{
  constexpr bool COMPENSATED = std::is_same<NUMBER, Compensated>::value;
  const double margin = COMPENSATED ? 2.0 * low_parts->grid().spacing : 0.0;    // the coordinate is a high part
  energy = 0.0;
  for (int i = 0; i < atom->nlocal; i++) {
    if (!(atom->mask[i] & groupbit)) continue;
    double *contact = array_atom[i];
    const double radius = atom->radius[i];
    const bool far = atom->x[i][1] - height > radius + margin;
    const NUMBER overlap = far ? NUMBER(0.0) : overlap_of<NUMBER>(i);
    if (leading(overlap) <= 0.0) {
      if (contact[OVERLAP] > 0.0) set_arrays(i);
      continue;
    }
    if (!(leading(overlap) <= radius))
      error->one(
          FLERR,
          "fix wall/mindlin/smooth: disk {} has its centre at {}, below the floor, where the contact law does not "
          "hold: lower the load or the time step, or raise KN",
          atom->tag[i], atom->x[i][1]);
    energy += law.normal_energy(value(overlap));
    contact_force<NUMBER, FRICTION, DAMPED>(i, overlap);
  }
}

template <class NUMBER, bool FRICTION, bool DAMPED> void FixWallMindlinSmooth::contact_force(int i, NUMBER overlap)
{
  constexpr bool COMPENSATED = std::is_same<NUMBER, Compensated>::value;
  const bool advance = !update->setupflag;    // at setup the disks have not moved
  const double radius = atom->radius[i];
  double *contact = array_atom[i];
  const bool known = contact[OVERLAP] > 0.0;    // a new contact begins without slip
  NUMBER slip = known && FRICTION ? contact[SLIP] : 0.0;
  if constexpr (COMPENSATED && FRICTION) slip.low = known ? contact[SLIP_LOW] : 0.0;
  double increment = known && FRICTION ? -(atom->v[i][0] + radius * atom->omega[i][2]) * update->dt : 0.0;
  if (known && FRICTION && law.rescales())
    increment = law.rescaled_increment(value(slip), increment, -atom->v[i][1] * update->dt, value(overlap));
  faultgouge::FloorRates rates{};
  if constexpr (DAMPED) {
    const double *const felt = dashpots->array_atom[i];
    rates = {felt[1], -(felt[0] + radius * felt[2])};
  }
  const bool counted = dissipating && advance && FRICTION;
  const auto [normal, tangential, kept, limit, slid, dashpot_power] = faultgouge::floor_contact(
      law, overlap, slip, increment, rates, {FRICTION, advance, DAMPED, law.history, counted});
  if (counted) contact[size_peratom_cols - 1] += slid + dashpot_power * update->dt;
  if constexpr (FRICTION) {
    contact[TANGENTIAL] = value(tangential);
    contact[SLIP] = leading(kept);
    contact[SLIP_RATIO] = value(limit) > 0.0 ? value(kept) / value(limit) : 0.0;
    if constexpr (COMPENSATED) contact[SLIP_LOW] = kept.low;
  }
  add_force<NUMBER>(i, -tangential, normal, -(radius * tangential));
  contact[NORMAL] = value(normal);
  contact[NX] = 0.0;
  contact[NY] = 1.0;
  contact[OVERLAP] = value(overlap);
}

double FixWallMindlinSmooth::compute_scalar()
{
  double total;
  MPI_Allreduce(&energy, &total, 1, MPI_DOUBLE, MPI_SUM, world);
  return total;
}

void *FixWallMindlinSmooth::extract(const char *name, int &dim)
{
  dim = 0;
  return law_parameter(law, name, damping);
}
