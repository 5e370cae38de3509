// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// Ways of running LAMMPS that the styles do not serve: they are refused before the run.

#ifndef FAULTGOUGE_RUN_STYLES_H
#define FAULTGOUGE_RUN_STYLES_H

#include "error.h"
#include "fix.h"
#include "update.h"
#include "utils.h"

namespace LAMMPS_NS {

// The levels of respa ask for forces and moves in parts, and slips would advance by steps that no disk makes.
inline bool runs_respa(const Update &update)
{
  return update.integrate_style && utils::strmatch(update.integrate_style, "^respa");
}

inline void refuse_respa(const Fix &fix, const Update &update, Error &error)
{
  if (update.whichflag == 1 && runs_respa(update))
    error.all(FLERR, "fix {} does not work under run_style respa: use run_style verlet", fix.style);
}

// rerun alone sets its last step, by default the largest there is, without a number of steps.
inline bool reruns(const Update &update)
{
  return update.whichflag == 1 && update.laststep != update.firststep + update.nsteps;
}

}    // namespace LAMMPS_NS

#endif
