#include "fix_disc_integrators.h"

#include "atom.h"
#include "domain.h"
#include "error.h"
#include "update.h"

#include <cmath>
#include <cstring>

using namespace LAMMPS_NS;
using namespace FixConst;

FixDiscIntegrator::FixDiscIntegrator(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
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

void FixDiscIntegrator::keywords(int narg, char **arg)
{
  for (int k = 0; k < narg; k += 2) {
    if (strcmp(arg[k], "rotation") != 0)
      error->all(FLERR, "fix {}: unknown keyword {}, use rotation yes or rotation no", style, arg[k]);
    if (k + 1 == narg) error->all(FLERR, "fix {}: rotation takes yes or no", style);
    rotation = utils::logical(FLERR, arg[k + 1], false, lmp) == 1;
  }
}

int FixDiscIntegrator::setmask()
{
  return INITIAL_INTEGRATE;
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
  reset_dt();
}

void FixDiscIntegrator::reset_dt()
{
  dt = update->dt;
}

template <bool ROTATION> void FixDiscIntegrator::move(int i)
{
  atom->x[i][0] += dt * atom->v[i][0];
  atom->x[i][1] += dt * atom->v[i][1];
  if constexpr (ROTATION)
    if (angle >= 0) atom->dvector[angle][i] += dt * atom->omega[i][2];
}

FixNVEDisc::FixNVEDisc(LAMMPS *lmp, int narg, char **arg) : FixDiscIntegrator(lmp, narg, arg)
{
  if (narg < 4) error->all(FLERR, "fix nve/disc takes one number, I0 = I/(m R^2), but got none");
  inertia_factor = positive_argument("I0", arg[3]);
  keywords(narg - 4, arg + 4);
}

int FixNVEDisc::setmask()
{
  return INITIAL_INTEGRATE | FINAL_INTEGRATE;
}

template <bool ROTATION> void FixNVEDisc::kick(int i)
{
  const double per_mass = 0.5 * dt / atom->rmass[i];
  atom->v[i][0] += per_mass * atom->f[i][0];
  atom->v[i][1] += per_mass * atom->f[i][1];
  if constexpr (ROTATION) {
    const double radius = atom->radius[i];
    atom->omega[i][2] += per_mass / (inertia_factor * radius * radius) * atom->torque[i][2];
  }
}

template <bool ROTATION> void FixNVEDisc::kick_and_move()
{
  for (int i = 0; i < atom->nlocal; i++)
    if (atom->mask[i] & groupbit) {
      kick<ROTATION>(i);
      move<ROTATION>(i);
    }
}

template <bool ROTATION> void FixNVEDisc::kick_all()
{
  for (int i = 0; i < atom->nlocal; i++)
    if (atom->mask[i] & groupbit) kick<ROTATION>(i);
}

void FixNVEDisc::initial_integrate(int /*vflag*/)
{
  if (rotation)
    kick_and_move<true>();
  else
    kick_and_move<false>();
}

void FixNVEDisc::final_integrate()
{
  if (rotation)
    kick_all<true>();
  else
    kick_all<false>();
}

FixOverdampedDisc::FixOverdampedDisc(LAMMPS *lmp, int narg, char **arg) : FixDiscIntegrator(lmp, narg, arg)
{
  if (narg < 5)
    error->all(FLERR, "fix overdamped/disc takes two numbers, GAMMA and I0 = I/(m R^2), but got {} arguments",
               narg - 3);
  damping = positive_argument("GAMMA", arg[3]);
  inertia_factor = positive_argument("I0", arg[4]);
  keywords(narg - 5, arg + 5);
}

void FixOverdampedDisc::initial_integrate(int /*vflag*/)
{
  if (rotation)
    relax<true>();
  else
    relax<false>();
}

template <bool ROTATION> void FixOverdampedDisc::relax()
{
  for (int i = 0; i < atom->nlocal; i++)
    if (atom->mask[i] & groupbit) {
      atom->v[i][0] = atom->f[i][0] / damping;
      atom->v[i][1] = atom->f[i][1] / damping;
      if constexpr (ROTATION) {
        const double radius = atom->radius[i];
        atom->omega[i][2] = atom->torque[i][2] / (damping * inertia_factor * radius * radius);
      }
      move<ROTATION>(i);
    }
}
