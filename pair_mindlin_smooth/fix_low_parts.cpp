#include "fix_low_parts.h"

#include "domain.h"
#include "memory.h"

#include <algorithm>
#include <cmath>

using namespace LAMMPS_NS;
using namespace FixConst;

FixLowParts::FixLowParts(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
  restart_peratom = 1;
  create_attribute = 1;
  peratom_flag = 1;
  peratom_freq = 1;
  size_peratom_cols = COLUMNS;
  maxexchange = COLUMNS;
  grow_arrays(atom->nmax);
  atom->add_callback(Atom::GROW);
  atom->add_callback(Atom::RESTART);
  for (int i = 0; i < atom->nlocal; i++) set_arrays(i);
}

FixLowParts::~FixLowParts()
{
  atom->delete_callback(id, Atom::GROW);
  atom->delete_callback(id, Atom::RESTART);
  memory->destroy(array_atom);
}

int FixLowParts::setmask()
{
  return PRE_EXCHANGE;
}

void FixLowParts::set_reach(double largest)
{
  spacing = faultgouge::FixedPointGrid::for_reach(largest);
}

// not above the length, so that a disk that is wrapped at one end lies inside of the other
double FixLowParts::period(int dimension) const
{
  return std::floor(domain->prd[dimension] / spacing.spacing) * spacing.spacing;
}

double FixLowParts::period_low(int dimension) const
{
  return domain->prd[dimension] - period(dimension);
}

void FixLowParts::setup_pre_exchange()
{
  for (int i = 0; i < atom->nlocal; i++)
    for (int d = 0; d < 2; d++) {
      const auto [high, low] = spacing.split({atom->x[i][d], array_atom[i][d]});
      atom->x[i][d] = high;
      array_atom[i][d] = low;
    }
  pre_exchange();
}

void FixLowParts::pre_exchange()
{
  for (int i = 0; i < atom->nlocal; i++)
    for (int d = 0; d < 2; d++)
      if (domain->periodicity[d]) wrap(i, d);
}

void FixLowParts::wrap(int i, int dimension)
{
  double &x = atom->x[i][dimension], &low = array_atom[i][dimension];
  while (x >= domain->boxhi[dimension] || x < domain->boxlo[dimension]) {
    const int back = x < domain->boxlo[dimension] ? 1 : -1;
    x += back * period(dimension);
    low += back * period_low(dimension);    // without a carry, which could put the disk outside again
    const int place = dimension * IMGBITS;
    const imageint mask = static_cast<imageint>(IMGMASK), times = ((atom->image[i] >> place) - back) & mask;
    atom->image[i] = (atom->image[i] & ~(mask << place)) | (times << place);
  }
}

void FixLowParts::complete_forces()
{
  for (int i = 0; i < atom->nlocal; i++) {
    double *const low = array_atom[i];
    atom->f[i][0] += low[FX];
    atom->f[i][1] += low[FY];
    atom->torque[i][2] += low[TORQUE];
    low[FX] = low[FY] = low[TORQUE] = 0.0;
  }
}

void FixLowParts::grow_arrays(int n)
{
  memory->grow(array_atom, n, COLUMNS, "low/parts:array");
  for (int i = nmax; i < n; i++) set_arrays(i);
  nmax = n;
}

void FixLowParts::copy_arrays(int i, int j, int /*delflag*/)
{
  std::copy(array_atom[i], array_atom[i] + COLUMNS, array_atom[j]);
}

void FixLowParts::set_arrays(int i)
{
  std::fill(array_atom[i], array_atom[i] + COLUMNS, 0.0);
}

int FixLowParts::pack_exchange(int i, double *buf)
{
  std::copy(array_atom[i], array_atom[i] + COLUMNS, buf);
  return COLUMNS;
}

int FixLowParts::unpack_exchange(int nlocal, double *buf)
{
  std::copy(buf, buf + COLUMNS, array_atom[nlocal]);
  return COLUMNS;
}

// LAMMPS finds a fix's data in a restart file by the length that starts each record
int FixLowParts::pack_restart(int i, double *buf)
{
  buf[0] = COLUMNS + 1;
  return 1 + pack_exchange(i, buf + 1);
}

void FixLowParts::unpack_restart(int nlocal, int nth)
{
  double *extra = atom->extra[nlocal];
  int m = 0;
  for (int i = 0; i < nth; i++) m += static_cast<int>(extra[m]);
  unpack_exchange(nlocal, extra + m + 1);
}

int FixLowParts::size_restart(int /*nlocal*/)
{
  return COLUMNS + 1;
}

int FixLowParts::maxsize_restart()
{
  return COLUMNS + 1;
}

double FixLowParts::memory_usage()
{
  return static_cast<double>(nmax) * COLUMNS * sizeof(double);
}
