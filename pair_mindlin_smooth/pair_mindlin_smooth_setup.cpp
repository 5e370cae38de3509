// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// What comes before a run and between runs: keywords, checks, fixes, restarts.

#include "pair_mindlin_smooth.h"

#include "atom.h"
#include "citeme.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "fix_disc_integrators.h"
#include "fix_weaken_friction.h"
#include "force.h"
#include "law_keywords.h"
#include "memory.h"
#include "modify.h"
#include "neighbor.h"
#include "run_styles.h"
#include "update.h"

#include <algorithm>
#include <cmath>
#include <cstring>

using namespace LAMMPS_NS;
using faultgouge::MindlinLaw;

// what LAMMPS lists at the end of a run among the papers to cite
static const char CITATION[] = "pair mindlin/smooth: arXiv:2106.11616\n\n"
                               "@misc{charan2021,\n"
                               " author = {Harish Charan and Anna Pomyalov and Itamar Procaccia},\n"
                               " title = {Generic Mechanism for Remote Triggering of Earthquakes},\n"
                               " year = {2021},\n"
                               " eprint = {2106.11616},\n"
                               " archivePrefix = {arXiv}\n"
                               "}\n\n";

PairMindlinSmooth::PairMindlinSmooth(LAMMPS *lmp) : Pair(lmp)
{
  if (lmp->citeme) lmp->citeme->add(CITATION);
  single_enable = 1;
  single_extra = 9;
  svector = new double[single_extra];
  restartinfo = 1;
  one_coeff = 1;
  finitecutflag = 1;
  no_virial_fdotr_compute = 1;    // forces act on owned disks only, so that a sum over ghosts would miss some
  centroidstressflag = CENTROID_SAME;
}

PairMindlinSmooth::~PairMindlinSmooth()
{
  if (history && modify->get_fix_by_id(FixSlipHistory::ID)) modify->delete_fix(FixSlipHistory::ID);
  if (low_parts && modify->get_fix_by_id(FixLowParts::ID)) modify->delete_fix(FixLowParts::ID);
  if (dashpots && modify->get_fix_by_id(FixDashpotVelocities::ID)) modify->delete_fix(FixDashpotVelocities::ID);
  delete[] svector;
  if (allocated) {
    memory->destroy(setflag);
    memory->destroy(cutsq);
    memory->destroy(largest_radius);
  }
}

void PairMindlinSmooth::allocate()
{
  allocated = 1;
  const int n = atom->ntypes + 1;
  memory->create(setflag, n, n, "pair:setflag");
  memory->create(cutsq, n, n, "pair:cutsq");
  memory->create(largest_radius, n, "pair:largest_radius");
  for (int i = 1; i < n; i++)
    for (int j = i; j < n; j++) setflag[i][j] = 0;
}

void PairMindlinSmooth::settings(int narg, char **arg)
{
  if (narg < 3)
    error->all(FLERR, "pair_style mindlin/smooth takes three numbers, KN KT MU, and keywords, but got {} arguments",
               narg);
  law = MindlinLaw();
  law.kn = utils::numeric(FLERR, arg[0], false, lmp);
  law.kt = utils::numeric(FLERR, arg[1], false, lmp);
  law.mu = utils::numeric(FLERR, arg[2], false, lmp);
  if (!law.valid())
    error->all(FLERR,
               "pair_style mindlin/smooth: KN must be positive, KT and MU not negative, all finite (got {} {} {})",
               arg[0], arg[1], arg[2]);
  const LawKeywords keywords = LawReader(lmp, "pair_style mindlin/smooth", law).read(3, narg, arg);
  compensated = keywords.compensated;
  damping = keywords.damping;
  energy = keywords.energy;
}

void PairMindlinSmooth::coeff(int narg, char **arg)
{
  if (narg != 2 || strcmp(arg[0], "*") != 0 || strcmp(arg[1], "*") != 0)
    error->all(FLERR, "pair mindlin/smooth has one law for all disks: use pair_coeff * *");
  if (!allocated) allocate();
  for (int i = 1; i <= atom->ntypes; i++)
    for (int j = i; j <= atom->ntypes; j++) setflag[i][j] = 1;
}

void PairMindlinSmooth::init_style()
{
  check_disks();
  // friction that weakens may be zero now and not later
  has_friction = law.frictional() || (law.kt > 0.0 && friction_weakens(*modify));
  if (energy && !has_friction)
    error->all(FLERR, "pair mindlin/smooth: without friction there is no history to keep the energy of contacts in: "
                      "use energy no, or MU and KT above 0");
  damped = damping && !displaces_disks(*modify);
  if (damped) check_damping();
  check_run();

  // newton off: pairs of owned disks once, pairs with ghosts at both their owners
  neighbor->add_request(this, NeighConst::REQ_NEWTON_OFF);

  make_fixes();
  if (compensated) check_integrators();
  comm_forward = (compensated ? 4 : 2) + (damped ? FixDashpotVelocities::FELT : 0);

  const double diameter = 2.0 * measure_radii();
  check_box(diameter);
  if (compensated) low_parts->set_reach(diameter);
  set_force_grids();
}

void PairMindlinSmooth::check_disks() const
{
  if (domain->dimension != 2) error->all(FLERR, "pair mindlin/smooth is for disks in the plane: use dimension 2");
  if (domain->triclinic) error->all(FLERR, "pair mindlin/smooth needs an orthogonal box, not a triclinic one");
  if (!atom->radius_flag || !atom->rmass_flag || !atom->omega_flag || !atom->torque_flag)
    error->all(FLERR, "pair mindlin/smooth needs disks with radius and spin: use atom_style sphere");
  if (atom->molecular != Atom::ATOMIC)
    error->all(FLERR, "pair mindlin/smooth is for single disks: use atom_style sphere without molecules");
}

void PairMindlinSmooth::check_run() const
{
  if (has_friction && !comm->ghost_velocity)
    error->all(FLERR, "pair mindlin/smooth needs the velocities of ghost disks: use comm_modify vel yes");
  if (update->whichflag == 1 && runs_respa(*update))
    error->all(FLERR,
               "pair mindlin/smooth does not work under run_style respa, since slips advance by whole steps: use "
               "run_style verlet");
  if (has_friction && reruns(*update))
    error->all(FLERR, "pair mindlin/smooth with friction cannot serve rerun, since snapshots have no slips: rerun with "
                      "MU = 0");
  for (const auto &fix : modify->get_fix_list())
    if (fix->diam_flag)
      error->all(FLERR,
                 "pair mindlin/smooth: fix {} of style {} changes radii within a run, but contacts are sought by the "
                 "radii at its begin: use the command set between runs",
                 fix->id, fix->style);
  if (compensated && update->whichflag == 2)
    error->all(FLERR, "pair mindlin/smooth: a minimizer does not carry the low parts of coordinates: minimize without "
                      "the keyword compensated");
  if (has_friction && update->whichflag == 2)
    error->all(FLERR,
               "pair mindlin/smooth with friction cannot be minimized, since its forces depend on the path: relax "
               "with fix overdamped/disc, or minimize with mu = 0");
}

// Returns the largest of all.
double PairMindlinSmooth::measure_radii()
{
  std::vector<double> mine(atom->ntypes + 1, 0.0);
  for (int i = 0; i < atom->nlocal; i++) mine[atom->type[i]] = std::max(mine[atom->type[i]], atom->radius[i]);
  MPI_Allreduce(mine.data(), largest_radius, atom->ntypes + 1, MPI_DOUBLE, MPI_MAX, world);
  return *std::max_element(largest_radius + 1, largest_radius + atom->ntypes + 1);
}

void PairMindlinSmooth::check_box(double diameter) const
{
  for (int d = 0; d < 2; d++)
    if (domain->periodicity[d] && domain->prd[d] < 2.0 * diameter)
      error->all(FLERR,
                 "pair mindlin/smooth: the periodic box is {} long in {}, less than two diameters of the largest disk "
                 "({}), and a disk could touch two images of one neighbour: use a larger box",
                 domain->prd[d], "xy"[d], diameter);
}

// An overlap of more than the smaller radius is refused.
void PairMindlinSmooth::set_force_grids()
{
  const double radius = *std::max_element(largest_radius + 1, largest_radius + atom->ntypes + 1);
  double normal = law.normal_force(radius);
  // no disk moves by more than its radius in a step, and the velocity that dashpots feel is up to three times that
  if (damped) normal += law.cn * law.growth(radius) * 6.0 * radius / update->dt;
  force_grid = faultgouge::SummationGrid::for_largest(normal * std::sqrt(1.0 + law.mu * law.mu));
  tangential_grid = faultgouge::SummationGrid::for_largest(normal * law.mu);
}

// made at init and not with the pair style, because data of a restart file reach a fix when it is made
void PairMindlinSmooth::make_fixes()
{
  history = dynamic_cast<FixSlipHistory *>(modify->get_fix_by_id(FixSlipHistory::ID));
  if (history && (!has_friction || history->compensated() != compensated || history->energy() != energy)) {
    modify->delete_fix(FixSlipHistory::ID);
    history = nullptr;
  }
  if (has_friction && !history)
    history = dynamic_cast<FixSlipHistory *>(modify->add_fix(fmt::format(
        "{} all slip/history{}{}", FixSlipHistory::ID, compensated ? " compensated" : "", energy ? " energy" : "")));
  if (history) history->set_source(this);
  slips_in_fix = true;

  low_parts = dynamic_cast<FixLowParts *>(modify->get_fix_by_id(FixLowParts::ID));
  if (compensated && !low_parts)
    low_parts = dynamic_cast<FixLowParts *>(modify->add_fix(fmt::format("{} all low/parts", FixLowParts::ID)));
  if (!compensated && low_parts) {
    modify->delete_fix(FixLowParts::ID);
    low_parts = nullptr;
  }
  make_dashpots();
}

void PairMindlinSmooth::make_dashpots()
{
  dashpots = dynamic_cast<FixDashpotVelocities *>(modify->get_fix_by_id(FixDashpotVelocities::ID));
  if (damping && !dashpots)
    dashpots = dynamic_cast<FixDashpotVelocities *>(
        modify->add_fix(fmt::format("{} all dashpot/velocities", FixDashpotVelocities::ID)));
  if (!damping && dashpots) {
    modify->delete_fix(FixDashpotVelocities::ID);
    dashpots = nullptr;
  }
}

void PairMindlinSmooth::check_damping() const
{
  if (update->whichflag == 2)
    error->all(FLERR, "pair mindlin/smooth: a minimizer has no velocities: minimize without the keyword damping");
  for (const auto &fix : modify->get_fix_list())
    if (dynamic_cast<const FixOverdampedDisc *>(fix))
      error->all(FLERR,
                 "pair mindlin/smooth: fix {} of style {} has no dynamics that dashpots could damp, and equilibria do "
                 "not depend on them: leave the keyword damping out",
                 fix->id, fix->style);
}

void PairMindlinSmooth::check_integrators() const
{
  for (const auto &fix : modify->get_fix_list()) {
    if (!fix->time_integrate) continue;
    const auto *integrator = dynamic_cast<const FixDiscIntegrator *>(fix);
    if (!integrator || !integrator->compensated())
      error->all(FLERR,
                 "pair mindlin/smooth: fix {} of style {} moves disks without the low parts of their coordinates: use "
                 "nve/disc, overdamped/disc or displace/disc with the keyword compensated",
                 fix->id, fix->style);
  }
}

double PairMindlinSmooth::init_one(int i, int j)
{
  if (!setflag[i][j]) error->all(FLERR, "pair mindlin/smooth has no coefficients: use pair_coeff * *");
  return largest_radius[i] + largest_radius[j];
}

// called by fix adapt after it has changed a parameter
void PairMindlinSmooth::reinit()
{
  if (!law.valid()) error->all(FLERR, "pair mindlin/smooth: KN KT MU became {} {} {}", law.kn, law.kt, law.mu);
  if (law.frictional() && !has_friction)
    error->all(FLERR, "pair mindlin/smooth: friction cannot be switched on within a run that began without");
  if (!law.valid_dashpots()) error->all(FLERR, "pair mindlin/smooth: CN CT became {} {}", law.cn, law.ct);
  set_force_grids();
}

void *PairMindlinSmooth::extract(const char *name, int &dim)
{
  dim = 0;
  return law_parameter(law, name, damping);
}

void PairMindlinSmooth::write_restart(FILE *fp)
{
  write_restart_settings(fp);
}

void PairMindlinSmooth::read_restart(FILE *fp)
{
  read_restart_settings(fp);
  allocate();
  for (int i = 1; i <= atom->ntypes; i++)
    for (int j = i; j <= atom->ntypes; j++) setflag[i][j] = 1;
}

namespace {

// What begins the settings in a restart file, and how they are laid out: five doubles, then four integers.
constexpr int RESTART_MARK = 0x4d444c53, RESTART_LAYOUT = 1;

}    // namespace

void PairMindlinSmooth::write_restart_settings(FILE *fp)
{
  const int head[2] = {RESTART_MARK, RESTART_LAYOUT};
  const double numbers[5] = {law.kn, law.kt, law.mu, law.cn, law.ct};
  const int words[4] = {law.exponent, static_cast<int>(law.history), compensated ? 1 : 0,
                        (damping ? 1 : 0) + (energy ? 2 : 0)};
  fwrite(head, sizeof(int), 2, fp);
  fwrite(numbers, sizeof(double), 5, fp);
  fwrite(words, sizeof(int), 4, fp);
}

void PairMindlinSmooth::read_restart_settings(FILE *fp)
{
  int head[2] = {0, 0}, words[4] = {0, 0, 0, 0};
  double numbers[5] = {0.0, 0.0, 0.0, 0.0, 0.0};
  if (comm->me == 0) utils::sfread(FLERR, head, sizeof(int), 2, fp, nullptr, error);
  MPI_Bcast(head, 2, MPI_INT, 0, world);
  if (head[0] != RESTART_MARK || head[1] != RESTART_LAYOUT)
    error->all(FLERR,
               "The restart file has the settings of pair_style mindlin/smooth of another version: read the file with "
               "the version that wrote it, write_data there, and read the data file here");
  if (comm->me == 0) {
    utils::sfread(FLERR, numbers, sizeof(double), 5, fp, nullptr, error);
    utils::sfread(FLERR, words, sizeof(int), 4, fp, nullptr, error);
  }
  MPI_Bcast(numbers, 5, MPI_DOUBLE, 0, world);
  MPI_Bcast(words, 4, MPI_INT, 0, world);
  law.kn = numbers[0];
  law.kt = numbers[1];
  law.mu = numbers[2];
  law.cn = numbers[3];
  law.ct = numbers[4];
  law.exponent = words[0];
  law.history = static_cast<decltype(law.history)>(words[1]);
  compensated = words[2] != 0;
  damping = words[3] & 1;
  energy = words[3] & 2;
}
