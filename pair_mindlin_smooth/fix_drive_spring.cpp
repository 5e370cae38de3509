// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "fix_drive_spring.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "fix_disc_integrators.h"
#include "fix_low_parts.h"
#include "modify.h"
#include "run_styles.h"
#include "update.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

using namespace LAMMPS_NS;
using namespace FixConst;
using faultgouge::ExactAccumulator;

FixDriveSpring::FixDriveSpring(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
  if (narg < 6) error->all(FLERR, "fix {} takes K or rigid, and velocity V or protocol V1 TIME1 V2 TIME2 ...", style);
  rigid = strcmp(arg[3], "rigid") == 0;
  if (!rigid) stiffness = utils::numeric(FLERR, arg[3], false, lmp);
  if (!rigid && !(stiffness > 0.0 && std::isfinite(stiffness)))
    error->all(FLERR, "fix {}: K = {} must be positive and finite", style, arg[3]);
  read_protocol(narg, arg);
  scalar_flag = vector_flag = 1;
  size_vector = 3;
  extscalar = extvector = 0;
  global_freq = 1;
  restart_global = 1;
}

void FixDriveSpring::read_protocol(int narg, char **arg)
{
  const auto number = [&](int k) {
    const double value = utils::numeric(FLERR, arg[k], false, lmp);
    if (!std::isfinite(value)) error->all(FLERR, "fix {}: {} is not finite", style, arg[k]);
    return value;
  };
  if (strcmp(arg[4], "velocity") == 0) {
    if (narg != 6) error->all(FLERR, "fix {} velocity takes one number, but got {}", style, narg - 5);
    protocol = {{number(5), std::numeric_limits<double>::infinity()}};
    return;
  }
  if (strcmp(arg[4], "protocol") != 0) error->all(FLERR, "fix {} knows velocity and protocol, not {}", style, arg[4]);
  if (narg % 2 == 0) error->all(FLERR, "fix {} protocol takes pairs of a velocity and a time", style);
  for (int k = 5; k < narg; k += 2) {
    protocol.push_back({number(k), number(k + 1)});
    if (protocol.back().duration <= 0.0)
      error->all(FLERR, "fix {} protocol: the time {} must be above 0", style, arg[k + 1]);
  }
}

int FixDriveSpring::setmask()
{
  return POST_NEIGHBOR | POST_FORCE;
}

void FixDriveSpring::init()
{
  refuse_respa(*this, *update, *error);
  if (update->whichflag == 2)
    error->all(FLERR, "fix {}: a minimizer has no time, in which the spring is drawn: unfix {} before", style, id);
  if (domain->triclinic) error->all(FLERR, "fix {} needs an orthogonal box", style);
  low_parts = dynamic_cast<FixLowParts *>(modify->get_fix_by_id(FixLowParts::ID));
  if (!rigid) return;
  for (const auto &fix : modify->get_fix_list())
    if (const auto *const moves = dynamic_cast<const FixNVEDisc *>(fix); moves && moves->drags())
      error->all(FLERR, "fix {} rigid does not work with the drag of fix {}: leave the drag out, or give a spring",
                 style, fix->id);
}

void FixDriveSpring::setup_post_neighbor()
{
  post_neighbor();
}

void FixDriveSpring::post_neighbor()
{
  layer.clear();
  for (int i = 0; i < atom->nlocal; i++)
    if (atom->mask[i] & groupbit) layer.push_back(i);
}

void FixDriveSpring::setup(int vflag)
{
  if (!has_origin) {
    ExactAccumulator sum;
    origin.disks = add_positions(sum);
    origin.less = ExactAccumulator();
    origin.less.subtract(sum);
    origin.step = update->ntimestep;
    has_origin = true;
    if (origin.disks == 0) error->all(FLERR, "fix {}: its group has no disks", style);
  }
  post_force(vflag);
}

void FixDriveSpring::move_far_end()
{
  double left = static_cast<double>(update->ntimestep - origin.step) * update->dt;
  way = 0.0;
  for (const auto &stage : protocol) {
    velocity = stage.velocity;
    const bool goes_on = left < stage.duration || &stage == &protocol.back();
    way += velocity * (goes_on ? left : stage.duration);
    if (goes_on) return;
    left -= stage.duration;
  }
}

bigint FixDriveSpring::add_positions(ExactAccumulator &sum) const
{
  std::int64_t disks = static_cast<std::int64_t>(layer.size()), periods = 0;
  if (comm->me > 0) sum = ExactAccumulator();    // what was in the sum counts once
  for (const int i : layer) {
    sum.add(atom->x[i][0]);
    if (low_parts) sum.add(low_parts->array_atom[i][FixLowParts::X]);
    periods += (atom->image[i] & IMGMASK) - IMGMAX;
  }
  if (comm->nprocs > 1) {
    constexpr int SIZE = ExactAccumulator::SIZE;
    std::int64_t all[SIZE + 2];
    std::copy_n(sum.integers(), SIZE, all);
    all[SIZE] = disks;
    all[SIZE + 1] = periods;
    MPI_Allreduce(MPI_IN_PLACE, all, SIZE + 2, MPI_INT64_T, MPI_SUM, world);
    std::copy_n(all, SIZE, sum.integers());
    disks = all[SIZE];
    periods = all[SIZE + 1];
  }
  if (periods == 0) return disks;
  const double count = static_cast<double>(periods);
  const auto add_product = [&](double length) {    // a product of doubles is the sum of two
    sum.add(count * length);
    sum.add(std::fma(count, length, -(count * length)));
  };
  add_product(low_parts ? low_parts->period(0) : domain->prd[0]);
  if (low_parts) add_product(low_parts->period_low(0));
  return disks;
}

double FixDriveSpring::hold_layer()
{
  ExactAccumulator all;
  for (const int i : layer) {
    all.add(atom->f[i][0]);
    atom->f[i][0] = 0.0;
    if (low_parts) all.add(std::exchange(low_parts->array_atom[i][FixLowParts::FX], 0.0));
    atom->v[i][0] = velocity;
  }
  if (comm->nprocs > 1) MPI_Allreduce(MPI_IN_PLACE, all.integers(), all.SIZE, MPI_INT64_T, MPI_SUM, world);
  return -all.sum() / static_cast<double>(origin.disks);
}

void FixDriveSpring::post_force(int /*vflag*/)
{
  move_far_end();
  ExactAccumulator moved = origin.less;
  const bigint disks = add_positions(moved);
  if (disks != origin.disks || disks == 0)
    error->all(FLERR, "fix {}: its group had {} disks when the spring began to draw, and has {} now", style,
               origin.disks, disks);
  displacement = moved.sum() / static_cast<double>(disks);
  if (rigid) {
    force = hold_layer();
    return;
  }
  force = stiffness * (way - displacement);
  for (const int i : layer) atom->f[i][0] += force;
}

void FixDriveSpring::write_restart(FILE *fp)
{
  if (comm->me != 0) return;
  const int size = sizeof(origin);
  fwrite(&size, sizeof(size), 1, fp);
  fwrite(&origin, sizeof(origin), 1, fp);
}

void FixDriveSpring::restart(char *stored)
{
  std::memcpy(&origin, stored, sizeof(origin));
  has_origin = origin.disks > 0;
}

double FixDriveSpring::compute_scalar()
{
  return force;
}

double FixDriveSpring::compute_vector(int k)
{
  const double values[] = {displacement, way, velocity};
  return values[k];
}
