#include "pair_mindlin_smooth.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "memory.h"
#include "modify.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "update.h"

#include <algorithm>
#include <cstring>

using namespace LAMMPS_NS;
using faultgouge::MindlinLaw;
using faultgouge::PairForce;

PairMindlinSmooth::PairMindlinSmooth(LAMMPS *lmp) : Pair(lmp)
{
  single_enable = 1;
  single_extra = 7;
  svector = new double[single_extra];
  restartinfo = 1;
  one_coeff = 1;
  finitecutflag = 1;
  no_virial_fdotr_compute = 1;    // forces act on owned disks only, so that a sum over ghosts would miss some
  centroidstressflag = CENTROID_SAME;
  comm_forward = 2;
}

PairMindlinSmooth::~PairMindlinSmooth()
{
  if (history && modify->get_fix_by_id(FixSlipHistory::ID)) modify->delete_fix(FixSlipHistory::ID);
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
  if (narg != 3)
    error->all(FLERR, "pair_style mindlin/smooth takes three numbers, KN KT MU, but got {} arguments", narg);
  law.kn = utils::numeric(FLERR, arg[0], false, lmp);
  law.kt = utils::numeric(FLERR, arg[1], false, lmp);
  law.mu = utils::numeric(FLERR, arg[2], false, lmp);
  if (!law.valid())
    error->all(FLERR,
               "pair_style mindlin/smooth: KN must be positive, KT and MU not negative, all finite (got {} {} {})",
               arg[0], arg[1], arg[2]);
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
  if (has_friction && !comm->ghost_velocity)
    error->all(FLERR, "pair mindlin/smooth needs the velocities of ghost disks: use comm_modify vel yes");
  if (has_friction && update->whichflag == 2)
    error->all(FLERR,
               "pair mindlin/smooth with friction cannot be minimized, since its forces depend on the path: relax "
               "with fix overdamped/disc, or minimize with mu = 0");

  // newton off: pairs of owned disks once, pairs with ghosts at both their owners
  neighbor->add_request(this, NeighConst::REQ_NEWTON_OFF);

  // made here and not with the pair style, because data of a restart file reach a fix when it is made
  history = dynamic_cast<FixSlipHistory *>(modify->get_fix_by_id(FixSlipHistory::ID));
  if (has_friction && !history)
    history = dynamic_cast<FixSlipHistory *>(modify->add_fix(fmt::format("{} all slip/history", FixSlipHistory::ID)));
  if (!has_friction && history) {
    modify->delete_fix(FixSlipHistory::ID);
    history = nullptr;
  }
  if (history) history->set_source(this);
  slips_in_fix = true;

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
}

void PairMindlinSmooth::rebuild_pairs()
{
  if (has_friction) {
    store_slips();
    history->check_owners();
  }
  pairs.build(*list, *atom, *domain, original, has_friction);
  if (!has_friction) return;
  for (int p = 0; p < pairs.size(); p++)
    if (const double *slip = history->find(pairs.first[p], pairs.second_tag[p])) {
      pairs.slip[p] = *slip;
      pairs.touching[p] = 1;
    }
}

void PairMindlinSmooth::compute(int eflag, int vflag)
{
  ev_init(eflag, vflag);
  if (comm->nprocs > 1 && (domain->xperiodic || domain->yperiodic)) communicate_originals();
  if (neighbor->ago == 0) rebuild_pairs();

  // at setup the disks have not moved since the slips were last advanced
  const bool advance = !update->setupflag;
  if (!has_friction)
    contact_forces<false, false>();
  else if (advance)
    contact_forces<true, true>();
  else
    contact_forces<true, false>();

  if (has_friction)
    sum_forces<true>();
  else
    sum_forces<false>();
  if (evflag) tally();
}

void PairMindlinSmooth::communicate_originals()
{
  original.resize(atom->nlocal + atom->nghost);
  for (int i = 0; i < atom->nlocal; i++) original[i] = {atom->x[i][0], atom->x[i][1]};
  comm->forward_comm(this);
}

int PairMindlinSmooth::pack_forward_comm(int n, int *list, double *buf, int /*pbc_flag*/, int * /*pbc*/)
{
  for (int k = 0; k < n; k++) {
    buf[2 * k] = original[list[k]].x;
    buf[2 * k + 1] = original[list[k]].y;
  }
  return 2 * n;
}

void PairMindlinSmooth::unpack_forward_comm(int n, int first, double *buf)
{
  for (int k = 0; k < n; k++) original[first + k] = {buf[2 * k], buf[2 * k + 1]};
}

// from the second disk of a pair to the first
inline faultgouge::Vector PairMindlinSmooth::branch(int p) const
{
  const int i = pairs.first[p], j = pairs.second[p];
  const double *const xi = atom->x[i], *const xj = atom->x[j];
  const auto image = pairs.image[p];
  if (image.x == 0 && image.y == 0) return {xi[0] - xj[0], xi[1] - xj[1]};
  const faultgouge::Vector other = j < atom->nlocal ? faultgouge::Vector{xj[0], xj[1]} : original[j];
  return {(xi[0] - other.x) - image.x * domain->prd[0], (xi[1] - other.y) - image.y * domain->prd[1]};
}

template <bool FRICTION, bool ADVANCE> void PairMindlinSmooth::contact_forces()
{
  const double *const *const v = atom->v;
  const double *const *const omega = atom->omega;
  const double *const radius = atom->radius;
  const double dt = update->dt;
  const MindlinLaw local = law;
  const double limit_ratio = FRICTION ? local.slip_limit_ratio() : 0.0;

  for (int p = 0, n = pairs.size(); p < n; p++) {
    const int i = pairs.first[p], j = pairs.second[p];
    const auto [rx, ry] = branch(p);
    const double reach = radius[i] + radius[j];
    const double rsq = rx * rx + ry * ry;
    double r, overlap;
    if (rsq >= reach * reach || (overlap = reach - (r = std::sqrt(rsq))) <= 0.0) {
      pairs.force[p] = PairForce{0.0, 0.0, 0.0};
      if constexpr (FRICTION) pairs.touching[p] = 0;
      continue;
    }
    if (r == 0.0)
      error->one(FLERR, "Disks {} and {} have the same centre, so that their contact has no direction",
                 pairs.first_tag[p], pairs.second_tag[p]);

    const double nx = rx / r, ny = ry / r;
    const double normal = local.normal_force(overlap);
    if constexpr (!FRICTION) {
      pairs.force[p] = PairForce{normal * nx, normal * ny, 0.0};
      continue;
    }

    const double limit = limit_ratio * overlap;
    double slip = pairs.touching[p] ? pairs.slip[p] : 0.0;
    if constexpr (ADVANCE) {
      if (pairs.touching[p]) {
        const faultgouge::Vector d{(v[i][0] - v[j][0]) * dt, (v[i][1] - v[j][1]) * dt};
        slip += faultgouge::midpoint_slip({rx, ry}, d) - (radius[i] * omega[i][2] + radius[j] * omega[j][2]) * dt;
      }
      slip = faultgouge::clamp_slip(slip, limit);
    }
    pairs.slip[p] = slip;
    pairs.touching[p] = 1;
    const double tangential = local.tangential_force(normal, slip, limit);
    pairs.force[p] = PairForce{normal * nx - tangential * ny, normal * ny + tangential * nx, tangential};
  }
  if constexpr (FRICTION) slips_in_fix = false;
}

template <bool FRICTION> void PairMindlinSmooth::sum_forces()
{
  double *const *const f = atom->f;
  double *const *const torque = atom->torque;
  for (int i = 0; i < atom->nlocal; i++) {
    double fx = 0.0, fy = 0.0, tangential = 0.0;
    for (int k = pairs.start[i]; k < pairs.start[i + 1]; k++) {
      const PairForce &contact = pairs.force[pairs.row[k] >> 1];
      const double sign = pairs.row[k] & 1 ? -1.0 : 1.0;
      fx += sign * contact.x;
      fy += sign * contact.y;
      if constexpr (FRICTION) tangential += contact.tangential;
    }
    f[i][0] += fx;
    f[i][1] += fy;
    if constexpr (FRICTION) torque[i][2] -= atom->radius[i] * tangential;
  }
}

// The energy is the elastic one of the normal force; the tangential force has none.
void PairMindlinSmooth::tally()
{
  for (int p = 0; p < pairs.size(); p++) {
    const PairForce &contact = pairs.force[p];
    if (contact.x == 0.0 && contact.y == 0.0) continue;
    const int i = pairs.first[p], j = pairs.second[p];
    const auto [rx, ry] = branch(p);
    const double overlap = atom->radius[i] + atom->radius[j] - std::sqrt(rx * rx + ry * ry);
    ev_tally_xyz(i, j, atom->nlocal, 0, law.normal_energy(overlap), 0.0, contact.x, contact.y, 0.0, rx, ry, 0.0);
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
      history->append(i, pairs.row[k] & 1 ? pairs.first_tag[p] : pairs.second_tag[p], pairs.slip[p]);
    }
  }
}

// The contact as it stands: nothing is advanced and nothing is written.
double PairMindlinSmooth::single(int i, int j, int, int, double rsq, double, double, double &fforce)
{
  std::fill(svector, svector + single_extra, 0.0);
  fforce = 0.0;
  const double r = std::sqrt(rsq), overlap = atom->radius[i] + atom->radius[j] - r;
  if (overlap <= 0.0) return 0.0;

  const double normal = law.normal_force(overlap);
  fforce = normal / r;
  svector[0] = normal;
  if (has_friction) {
    store_slips();
    const double *stored = i < atom->nlocal ? history->find(i, atom->tag[j]) : history->find(j, atom->tag[i]);
    const double limit = law.slip_limit_ratio() * overlap;
    const double slip = stored ? *stored : 0.0;
    svector[1] = law.tangential_force(normal, slip, limit);
    svector[2] = slip;
    svector[3] = limit > 0.0 ? slip / limit : 0.0;
  }
  svector[4] = (atom->x[i][0] - atom->x[j][0]) / r;
  svector[5] = (atom->x[i][1] - atom->x[j][1]) / r;
  svector[6] = overlap;
  return law.normal_energy(overlap);
}

void *PairMindlinSmooth::extract(const char *name, int &dim)
{
  dim = 0;
  if (strcmp(name, "kn") == 0) return &law.kn;
  if (strcmp(name, "kt") == 0) return &law.kt;
  if (strcmp(name, "mu") == 0) return &law.mu;
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
}

void PairMindlinSmooth::read_restart_settings(FILE *fp)
{
  if (comm->me == 0) utils::sfread(FLERR, &law, sizeof(MindlinLaw), 1, fp, nullptr, error);
  MPI_Bcast(&law, sizeof(MindlinLaw), MPI_BYTE, 0, world);
}

double PairMindlinSmooth::memory_usage()
{
  const double per_pair = 2 * sizeof(int) + 2 * sizeof(tagint) + sizeof(PairForce) + sizeof(double) + 1;
  return Pair::memory_usage() + pairs.size() * per_pair + (pairs.row.size() + pairs.start.size()) * sizeof(int);
}
