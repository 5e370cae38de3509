// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

#include "law_keywords.h"

#include "error.h"
#include "utils.h"

#include <cstring>
#include <string>

using namespace LAMMPS_NS;

// "1.5 or 1"
static std::string known_exponents()
{
  std::string found;
  for (int place = 0; place < faultgouge::Exponents::SIZE; place++)
    found +=
        fmt::format("{}{:g}", place ? " or " : "", faultgouge::Exponents::at(place, [](auto p) { return p.EXPONENT; }));
  return found;
}

LawKeywords LawReader::read(int first, int narg, char **arg)
{
  LawKeywords found;
  for (int k = first; k < narg; k++) {
    if (strcmp(arg[k], "compensated") == 0) {
      found.compensated = true;
    } else if (strcmp(arg[k], "exponent") == 0) {
      if (++k >= narg || !law.set_exponent(utils::numeric(FLERR, arg[k], false, lmp)))
        error->all(FLERR, "{}: exponent must be {}, not {}", command, known_exponents(),
                   k < narg ? arg[k] : "left out");
    } else if (strcmp(arg[k], "history") == 0) {
      if (++k >= narg || !law.set_history(arg[k]))
        error->all(FLERR, "{}: history must be total, rescaled or coulomb, not {}", command,
                   k < narg ? arg[k] : "left out");
    } else if (strcmp(arg[k], "damping") == 0) {
      if (k + 2 >= narg) error->all(FLERR, "{}: damping takes two numbers, CN CT", command);
      read_dashpots(arg[k + 1], arg[k + 2]);
      found.damping = true;
      k += 2;
    } else if (strcmp(arg[k], "energy") == 0) {
      if (++k >= narg) error->all(FLERR, "{}: energy must be yes or no", command);
      found.energy = utils::logical(FLERR, arg[k], false, lmp);
    } else {
      error->all(FLERR, "{} knows the keywords exponent, history, damping, energy and compensated, but not {}", command,
                 arg[k]);
    }
  }
  if (!law.valid_history())
    error->all(
        FLERR,
        "{}: history rescaled needs an exponent of {} or more: with less the stiffness depends too little on the "
        "overlap, and the smoothed force creates energy all the same",
        command, faultgouge::MindlinLaw::LEAST_RESCALED);
  return found;
}

void LawReader::read_dashpots(const char *cn, const char *ct)
{
  law.cn = utils::numeric(FLERR, cn, false, lmp);
  law.ct = utils::numeric(FLERR, ct, false, lmp);
  if (!law.valid_dashpots())
    error->all(FLERR, "{}: damping CN CT must be finite and not negative (got {} {})", command, cn, ct);
}

double *LAMMPS_NS::law_parameter(faultgouge::MindlinLaw &law, const char *name, bool damping)
{
  if (strcmp(name, "kn") == 0) return &law.kn;
  if (strcmp(name, "kt") == 0) return &law.kt;
  if (strcmp(name, "mu") == 0) return &law.mu;
  if (damping && strcmp(name, "cn") == 0) return &law.cn;
  if (damping && strcmp(name, "ct") == 0) return &law.ct;
  return nullptr;
}
