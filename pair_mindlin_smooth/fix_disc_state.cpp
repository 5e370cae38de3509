#include "fix_disc_state.h"

#include "atom.h"
#include "error.h"

using namespace LAMMPS_NS;
using namespace FixConst;

FixDiscState::FixDiscState(LAMMPS *lmp, int narg, char **arg) : FixDiskColumns(lmp, narg, arg)
{
  if (narg != 3) error->all(FLERR, "fix state/disc takes no arguments, but got {}", narg - 3);
  if (!atom->radius_flag || !atom->omega_flag || !atom->torque_flag)
    error->all(FLERR, "fix state/disc needs disks with radius and spin: use atom_style sphere");
  make_columns(COLUMNS);
  post_run();
}

int FixDiscState::setmask()
{
  return PRE_EXCHANGE | POST_RUN;
}

double *FixDiscState::angles() const
{
  int is_double, columns;
  const int index = atom->find_custom("theta", is_double, columns);
  return index >= 0 && is_double && columns == 0 ? atom->dvector[index] : nullptr;
}

void FixDiscState::setup_pre_exchange()
{
  double *const theta = angles();
  for (int i = 0; i < atom->nlocal; i++) {
    double *const state = array_atom[i];
    if (state[GIVEN] == 0.0) continue;
    state[GIVEN] = 0.0;
    atom->x[i][0] = state[X];
    atom->x[i][1] = state[Y];
    atom->v[i][0] = state[VX];
    atom->v[i][1] = state[VY];
    atom->omega[i][2] = state[OMEGA];
    if (theta) theta[i] = state[THETA];
  }
}

void FixDiscState::post_run()
{
  const double *const theta = angles();
  for (int i = 0; i < atom->nlocal; i++) {
    double *const state = array_atom[i];
    state[GIVEN] = 0.0;
    state[X] = atom->x[i][0];
    state[Y] = atom->x[i][1];
    state[THETA] = theta ? theta[i] : 0.0;
    state[VX] = atom->v[i][0];
    state[VY] = atom->v[i][1];
    state[OMEGA] = atom->omega[i][2];
    state[FX] = atom->f[i][0];
    state[FY] = atom->f[i][1];
    state[TORQUE] = atom->torque[i][2];
  }
}
