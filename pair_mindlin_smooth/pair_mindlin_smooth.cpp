#include "pair_mindlin_smooth.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "fix_disc_integrators.h"
#include "force.h"
#include "memory.h"
#include "modify.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "update.h"

#include <algorithm>
#include <cstring>

using namespace LAMMPS_NS;
using faultgouge::Compensated;
using faultgouge::Disks;
using faultgouge::Features;
using faultgouge::leading;
using faultgouge::MindlinLaw;
using faultgouge::PairForce;
using faultgouge::Period;
using faultgouge::value;

PairMindlinSmooth::PairMindlinSmooth(LAMMPS *lmp) : Pair(lmp)
{
  single_enable = 1;
  single_extra = 8;
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
  read_keywords(narg, arg);
}

void PairMindlinSmooth::read_keywords(int narg, char **arg)
{
  compensated = damping = false;
  for (int k = 3; k < narg; k++) {
    if (strcmp(arg[k], "compensated") == 0) {
      compensated = true;
    } else if (strcmp(arg[k], "exponent") == 0) {
      if (++k >= narg || !law.set_exponent(utils::numeric(FLERR, arg[k], false, lmp)))
        error->all(FLERR, "pair_style mindlin/smooth: exponent must be 1.5 or 1, not {}",
                   k < narg ? arg[k] : "left out");
    } else if (strcmp(arg[k], "damping") == 0) {
      if (k + 2 >= narg) error->all(FLERR, "pair_style mindlin/smooth: damping takes two numbers, CN CT");
      law.cn = utils::numeric(FLERR, arg[++k], false, lmp);
      law.ct = utils::numeric(FLERR, arg[++k], false, lmp);
      if (!law.valid_dashpots())
        error->all(FLERR, "pair_style mindlin/smooth: damping CN CT must be finite and not negative (got {} {})",
                   arg[k - 1], arg[k]);
      damping = true;
    } else {
      error->all(FLERR, "pair_style mindlin/smooth knows the keywords exponent, damping and compensated, but not {}",
                 arg[k]);
    }
  }
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
  if (domain->dimension != 2) error->all(FLERR, "pair mindlin/smooth is for disks in the plane: use dimension 2");
  if (domain->triclinic) error->all(FLERR, "pair mindlin/smooth needs an orthogonal box, not a triclinic one");
  if (!atom->radius_flag || !atom->rmass_flag || !atom->omega_flag || !atom->torque_flag)
    error->all(FLERR, "pair mindlin/smooth needs disks with radius and spin: use atom_style sphere");
  if (atom->molecular != Atom::ATOMIC)
    error->all(FLERR, "pair mindlin/smooth is for single disks: use atom_style sphere without molecules");

  has_friction = law.frictional();
  damped = damping && !displaces_disks(*modify);
  if (damped) check_damping();
  if (has_friction && !comm->ghost_velocity)
    error->all(FLERR, "pair mindlin/smooth needs the velocities of ghost disks: use comm_modify vel yes");
  if (compensated && update->whichflag == 2)
    error->all(FLERR, "pair mindlin/smooth: a minimizer does not carry the low parts of coordinates: minimize without "
                      "the keyword compensated");
  if (has_friction && update->whichflag == 2)
    error->all(FLERR,
               "pair mindlin/smooth with friction cannot be minimized, since its forces depend on the path: relax "
               "with fix overdamped/disc, or minimize with mu = 0");

  // newton off: pairs of owned disks once, pairs with ghosts at both their owners
  neighbor->add_request(this, NeighConst::REQ_NEWTON_OFF);

  make_fixes();
  if (compensated) check_integrators();
  comm_forward = (compensated ? 4 : 2) + (damped ? FixDashpotVelocities::FELT : 0);

  std::vector<double> mine(atom->ntypes + 1, 0.0);
  for (int i = 0; i < atom->nlocal; i++) mine[atom->type[i]] = std::max(mine[atom->type[i]], atom->radius[i]);
  MPI_Allreduce(mine.data(), largest_radius, atom->ntypes + 1, MPI_DOUBLE, MPI_MAX, world);

  const double diameter = 2.0 * *std::max_element(largest_radius + 1, largest_radius + atom->ntypes + 1);
  for (int d = 0; d < 2; d++)
    if (domain->periodicity[d] && domain->prd[d] < 2.0 * diameter)
      error->all(FLERR,
                 "pair mindlin/smooth: the periodic box is {} long in {}, less than two diameters of the largest disk "
                 "({}), and a disk could touch two images of one neighbour: use a larger box",
                 domain->prd[d], "xy"[d], diameter);
  if (compensated) low_parts->set_reach(diameter);
  set_force_grids();
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
  if (history && (!has_friction || history->compensated() != compensated)) {
    modify->delete_fix(FixSlipHistory::ID);
    history = nullptr;
  }
  if (has_friction && !history)
    history = dynamic_cast<FixSlipHistory *>(
        modify->add_fix(fmt::format("{} all slip/history{}", FixSlipHistory::ID, compensated ? " compensated" : "")));
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

void PairMindlinSmooth::rebuild_pairs()
{
  if (has_friction) {
    store_slips();
    history->check_owners();
  }
  pairs.build(*list, neighbor->skin, *atom, *domain, original, has_friction, compensated);
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
  }
}

void PairMindlinSmooth::compute(int eflag, int vflag)
{
  ev_init(eflag, vflag);
  if (damped) collect_felt();
  if (comm->nprocs > 1 && (compensated || damped || domain->xperiodic || domain->yperiodic)) communicate_originals();
  if (neighbor->ago == 0) rebuild_pairs();
  if (has_friction && slips_in_fix) load_slips();    // somebody may have written others

  // at setup the disks have not moved since the slips were last advanced
  const int crushed = contact_forces(!update->setupflag);
  if (crushed >= 0) refuse(crushed);

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

void PairMindlinSmooth::collect_felt()
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
  const Features features{has_friction, advance, damped};
  if (!compensated) return faultgouge::contact_forces(pairs, disks(), period(), law, dt, features);
  return faultgouge::compensated_contact_forces(pairs, disks(), period(), law, dt, features,
                                                {low_parts->grid(), force_grid, tangential_grid});
}

void PairMindlinSmooth::refuse(int p) const
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
                      compensated ? pairs.slip_low[p] : 0.0);
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
    if (stored && compensated) svector[7] = stored[1];
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

void *PairMindlinSmooth::extract(const char *name, int &dim)
{
  dim = 0;
  if (strcmp(name, "kn") == 0) return &law.kn;
  if (strcmp(name, "kt") == 0) return &law.kt;
  if (strcmp(name, "mu") == 0) return &law.mu;
  if (damping && strcmp(name, "cn") == 0) return &law.cn;
  if (damping && strcmp(name, "ct") == 0) return &law.ct;
  return nullptr;
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

void PairMindlinSmooth::write_restart_settings(FILE *fp)
{
  fwrite(&law, sizeof(MindlinLaw), 1, fp);
  fwrite(&compensated, sizeof(bool), 1, fp);
  fwrite(&damping, sizeof(bool), 1, fp);
}

void PairMindlinSmooth::read_restart_settings(FILE *fp)
{
  if (comm->me == 0) {
    utils::sfread(FLERR, &law, sizeof(MindlinLaw), 1, fp, nullptr, error);
    utils::sfread(FLERR, &compensated, sizeof(bool), 1, fp, nullptr, error);
    utils::sfread(FLERR, &damping, sizeof(bool), 1, fp, nullptr, error);
  }
  MPI_Bcast(&law, sizeof(MindlinLaw), MPI_BYTE, 0, world);
  MPI_Bcast(&compensated, sizeof(bool), MPI_BYTE, 0, world);
  MPI_Bcast(&damping, sizeof(bool), MPI_BYTE, 0, world);
}

double PairMindlinSmooth::memory_usage()
{
  const double force = compensated ? sizeof(double) : sizeof(PairForce);    // a low part of the slip, or a force
  const double per_pair = 3 * sizeof(int) + 2 * sizeof(tagint) + 2 + sizeof(double) + force;
  const double per_disk = sizeof(int) + (compensated ? sizeof(faultgouge::CompensatedForce) : 0);
  return Pair::memory_usage() + pairs.size() * per_pair + pairs.row.size() * sizeof(int) +
         pairs.start.size() * per_disk;
}
