// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "fix_addforce_signal.h"

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "input.h"
#include "run_styles.h"
#include "update.h"
#include "utils.h"
#include "variable.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

using namespace LAMMPS_NS;
using namespace FixConst;

static constexpr double ONSET_OF_PULSE = 10.0;    // omega t at its peak: at t = 0 it is 1e-9 of that

FixAddForceSignal::FixAddForceSignal(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
  scalar_flag = 1;
  global_freq = 1;
  extscalar = 0;
  dynamic_group_allow = 1;
  read_keywords(read_kind(narg, arg), narg, arg);
  if (kind == Kind::RECORD) read_record();
}

int FixAddForceSignal::read_kind(int narg, char **arg)
{
  const std::string name = narg > 3 ? arg[3] : "";
  const auto numbers = [&](const char *needs, std::vector<double *> wanted) {
    if (narg < 4 + static_cast<int>(wanted.size())) error->all(FLERR, "fix {} {} takes {}", style, name, needs);
    for (size_t k = 0; k < wanted.size(); k++) {
      *wanted[k] = utils::numeric(FLERR, arg[4 + k], false, lmp);
      if (!std::isfinite(*wanted[k])) error->all(FLERR, "fix {} {}: {} is not finite", style, name, arg[4 + k]);
    }
    return 4 + static_cast<int>(wanted.size());
  };
  if (name == "cosine") {
    kind = Kind::COSINE;
    return numbers("A OMEGA", {&amplitude, &omega});
  }
  if (name == "pulse") {
    kind = Kind::PULSE;
    const int next = numbers("A OMEGA", {&amplitude, &omega});
    if (omega <= 0.0) error->all(FLERR, "fix {} pulse: OMEGA = {} must be above 0", style, omega);
    return next;
  }
  if (name == "sweep") {
    kind = Kind::SWEEP;
    const int next = numbers("A OMEGA OMEGA_END TIME", {&amplitude, &omega, &omega_end, &duration});
    if (duration <= 0.0) error->all(FLERR, "fix {} sweep: TIME = {} must be above 0", style, duration);
    return next;
  }
  if (name != "record")
    error->all(FLERR, "fix {} knows cosine, pulse, sweep and record, not {}", style, name.empty() ? "nothing" : name);
  kind = Kind::RECORD;
  if (narg < 5) error->all(FLERR, "fix {} record needs the name of a file with two columns, time and value", style);
  file = arg[4];
  if (utils::strmatch(file, "^v_")) {
    const char *const held = input->variable->retrieve(arg[4] + 2);
    if (!held) error->all(FLERR, "fix {} record: there is no variable {}", style, arg[4] + 2);
    file = held;
  }
  return 5;
}

void FixAddForceSignal::read_keywords(int first, int narg, char **arg)
{
  for (int k = first; k < narg; k += 2) {
    const std::string keyword = arg[k], value = k + 1 < narg ? arg[k + 1] : "";
    const bool of_record = kind == Kind::RECORD && (keyword == "scale" || keyword == "stretch");
    if (keyword == "on") {
      if (value != "layer" && value != "floor")
        error->all(FLERR, "fix {}: on is layer or floor, not {}", style, value.empty() ? "left out" : value);
      on_floor = value == "floor";
    } else if (of_record) {
      if (value.empty()) error->all(FLERR, "fix {}: {} needs a number", style, keyword);
      (keyword == "scale" ? scale : stretch) = utils::numeric(FLERR, arg[k + 1], false, lmp);
    } else {
      error->all(FLERR, "fix {} {} knows the keyword{}, not {}", style, arg[3],
                 kind == Kind::RECORD ? "s scale, stretch and on" : " on", keyword);
    }
  }
  if (!std::isfinite(scale)) error->all(FLERR, "fix {}: scale = {} is not finite", style, scale);
  if (!(stretch > 0.0 && std::isfinite(stretch)))
    error->all(FLERR, "fix {}: stretch = {} must be above 0", style, stretch);
}

// On rank 0 alone, which tells the others.
void FixAddForceSignal::read_record()
{
  std::string says = comm->me == 0 ? read_table() : "";
  int size[2] = {static_cast<int>(says.size()), static_cast<int>(times.size())};
  MPI_Bcast(size, 2, MPI_INT, 0, world);
  says.resize(size[0]);
  MPI_Bcast(&says[0], size[0], MPI_CHAR, 0, world);
  if (!says.empty()) error->all(FLERR, "fix {}: {} {}", style, file, says);
  times.resize(size[1]);
  values.resize(size[1]);
  MPI_Bcast(times.data(), size[1], MPI_DOUBLE, 0, world);
  MPI_Bcast(values.data(), size[1], MPI_DOUBLE, 0, world);
}

// Returns what is wrong with the table, or nothing.
std::string FixAddForceSignal::read_table()
{
  std::ifstream stream(file);
  if (!stream) return "cannot be read: correct its name";
  std::string line;
  for (int number = 1; std::getline(stream, line); number++) {
    line = line.substr(0, line.find('#'));
    if (line.find_first_not_of(" \t\r,") == std::string::npos) continue;
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream columns(line);
    std::string first, second, more;
    columns >> first >> second;
    if (second.empty() || columns >> more || !utils::is_double(first) || !utils::is_double(second))
      return "has something else than two numbers, time and value, in line " + std::to_string(number);
    const double time = std::strtod(first.c_str(), nullptr), value = std::strtod(second.c_str(), nullptr);
    if (!std::isfinite(time) || !std::isfinite(value))
      return "has a number that is not finite in line " + std::to_string(number);
    if (!times.empty() && time <= times.back())
      return "has a time that is not later than the one before in line " + std::to_string(number) + ": sort it";
    times.push_back(time);
    values.push_back(value);
  }
  return times.size() < 2 ? "has fewer than two rows: a signal needs a beginning and an end" : "";
}

int FixAddForceSignal::setmask()
{
  return POST_FORCE;
}

void FixAddForceSignal::init()
{
  refuse_respa(*this, *update, *error);
  if (update->whichflag == 2)
    error->all(FLERR, "fix {}: a minimizer has no time, on which the force depends: unfix {} before", style, id);
  if (kind != Kind::RECORD) return;
  double shortest = times[1] - times[0];
  for (size_t k = 2; k < times.size(); k++) shortest = std::min(shortest, times[k] - times[k - 1]);
  if (comm->me == 0 && update->dt > shortest * stretch)
    error->warning(FLERR, "fix {}: rows of {} are closer than the time step, some are never seen", style, file);
}

void FixAddForceSignal::setup(int vflag)
{
  post_force(vflag);
}

void FixAddForceSignal::post_force(int /*vflag*/)
{
  const double value = compute_scalar();
  double *const *const f = atom->f;
  const int *const mask = atom->mask, nlocal = atom->nlocal;
  if (!on_floor) {
    for (int i = 0; i < nlocal; i++)
      if (mask[i] & groupbit) f[i][0] += value;
    return;
  }
  for (int i = 0; i < nlocal; i++)
    if (mask[i] & groupbit) f[i][0] -= (atom->rmass ? atom->rmass[i] : atom->mass[atom->type[i]]) * value;
}

double FixAddForceSignal::compute_scalar()
{
  return at(static_cast<double>(update->ntimestep) * update->dt);
}

double FixAddForceSignal::at(double time) const
{
  if (kind == Kind::COSINE) return amplitude * std::cos(omega * time);
  if (kind == Kind::RECORD) return at_in_table(time / stretch);
  if (kind == Kind::SWEEP) {
    if (time < 0.0 || time > duration) return 0.0;
    return amplitude * std::sin(omega * time + 0.5 * (omega_end - omega) * time * time / duration);
  }
  const double x = 0.5 * (omega * time - ONSET_OF_PULSE);
  if (std::fabs(x) > 0.5 * ONSET_OF_PULSE) return 0.0;
  // exp needs the glibc of 2019; expm1 is older, and rounds to the last place of the peak
  return amplitude * (1.0 - 2.0 * x * x) * (1.0 + std::expm1(-x * x));
}

double FixAddForceSignal::at_in_table(double time) const
{
  if (time < times.front() || time > times.back()) return 0.0;
  const auto after =
      std::min<size_t>(std::upper_bound(times.begin(), times.end(), time) - times.begin(), times.size() - 1);
  const double share = (time - times[after - 1]) / (times[after] - times[after - 1]);
  return scale * (values[after - 1] + share * (values[after] - values[after - 1]));
}

double FixAddForceSignal::memory_usage()
{
  return 2.0 * times.size() * sizeof(double);
}
