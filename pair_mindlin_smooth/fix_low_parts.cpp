// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "fix_low_parts.h"

#include "domain.h"

#include <algorithm>
#include <cmath>

using namespace LAMMPS_NS;
using namespace FixConst;

FixLowParts::FixLowParts(LAMMPS *lmp, int narg, char **arg) : FixDiskColumns(lmp, narg, arg)
{
  make_columns(COLUMNS);
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
