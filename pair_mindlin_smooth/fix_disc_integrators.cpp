#include "fix_disc_integrators.h"

#include "atom.h"
#include "domain.h"
#include "error.h"
#include "fix_low_parts.h"
#include "modify.h"
#include "update.h"

#include <cmath>
#include <cstring>

using namespace LAMMPS_NS;
using namespace FixConst;

FixDiscIntegrator::FixDiscIntegrator(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
  carries_low_parts = narg > 3 && strcmp(arg[narg - 1], "compensated") == 0;
  numbers = narg - 3 - (carries_low_parts ? 1 : 0);
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
  return INITIAL_INTEGRATE | FINAL_INTEGRATE;
}

void FixDiscIntegrator::init()
{
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
  if (low_parts) low_parts->complete_forces();
}

void FixDiscIntegrator::reset_dt()
{
  dt = update->dt;
}

void FixDiscIntegrator::move(int i)
{
  const double dx = dt * atom->v[i][0], dy = dt * atom->v[i][1];
  if (!(dx * dx + dy * dy <= atom->radius[i] * atom->radius[i]))
    error->one(FLERR,
               "fix {}: disk {} would move by ({}, {}) in one step, farther than its radius {}: the time step is too "
               "long, or a force too large",
               style, atom->tag[i], dx, dy, atom->radius[i]);
  if (low_parts) {
    low_parts->move(i, dx, dy);
  } else {
    atom->x[i][0] += dx;
    atom->x[i][1] += dy;
  }
  if (angle >= 0) atom->dvector[angle][i] += dt * atom->omega[i][2];
}

FixNVEDisc::FixNVEDisc(LAMMPS *lmp, int narg, char **arg) : FixDiscIntegrator(lmp, narg, arg)
{
  if (numbers != 1)
    error->all(FLERR, "fix nve/disc takes one number, I0 = I/(m R^2), and optionally compensated, but got {} numbers",
               numbers);
  inertia_factor = positive_argument("I0", arg[3]);
}

void FixNVEDisc::kick(int i)
{
  const double radius = atom->radius[i];
  const double per_mass = 0.5 * dt / atom->rmass[i];
  atom->v[i][0] += per_mass * atom->f[i][0];
  atom->v[i][1] += per_mass * atom->f[i][1];
  atom->omega[i][2] += per_mass / (inertia_factor * radius * radius) * atom->torque[i][2];
}

void FixNVEDisc::initial_integrate(int /*vflag*/)
{
  for (int i = 0; i < atom->nlocal; i++)
    if (atom->mask[i] & groupbit) {
      kick(i);
      move(i);
    }
}

void FixNVEDisc::final_integrate()
{
  complete_forces();
  for (int i = 0; i < atom->nlocal; i++)
    if (atom->mask[i] & groupbit) kick(i);
}

FixDisplaceDisc::FixDisplaceDisc(LAMMPS *lmp, int narg, char **arg) : FixDiscIntegrator(lmp, narg, arg)
{
  if (numbers != 0) error->all(FLERR, "fix displace/disc takes no argument but compensated, but got {}", arg[3]);
}

void FixDisplaceDisc::initial_integrate(int /*vflag*/)
{
  for (int i = 0; i < atom->nlocal; i++)
    if (atom->mask[i] & groupbit) move(i);
}

FixOverdampedDisc::FixOverdampedDisc(LAMMPS *lmp, int narg, char **arg) : FixDiscIntegrator(lmp, narg, arg)
{
  if (numbers != 2)
    error->all(
        FLERR,
        "fix overdamped/disc takes two numbers, GAMMA and I0 = I/(m R^2), and optionally compensated, but got {} "
        "numbers",
        numbers);
  damping = positive_argument("GAMMA", arg[3]);
  inertia_factor = positive_argument("I0", arg[4]);
}

void FixOverdampedDisc::initial_integrate(int /*vflag*/)
{
  for (int i = 0; i < atom->nlocal; i++)
    if (atom->mask[i] & groupbit) {
      const double radius = atom->radius[i];
      atom->v[i][0] = atom->f[i][0] / damping;
      atom->v[i][1] = atom->f[i][1] / damping;
      atom->omega[i][2] = atom->torque[i][2] / (damping * inertia_factor * radius * radius);
      move(i);
    }
}
