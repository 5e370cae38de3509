// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// The keywords that follow KN KT MU in the commands of the pair style and of the floor.

#ifndef FAULTGOUGE_LAW_KEYWORDS_H
#define FAULTGOUGE_LAW_KEYWORDS_H

#include "mindlin_law.h"
#include "pointers.h"

namespace LAMMPS_NS {

struct LawKeywords {
  bool compensated = false;
  bool damping = false;    // the keyword was given
  bool energy = false;     // the keyword says yes
};

class LawReader : protected Pointers {
public:
  LawReader(LAMMPS *lmp, const char *command, faultgouge::MindlinLaw &law) : Pointers(lmp), command(command), law(law)
  {
  }

  // of the arguments from first on
  LawKeywords read(int first, int narg, char **arg);
  void read_dashpots(const char *cn, const char *ct);

private:
  const char *command;    // its name, for messages
  faultgouge::MindlinLaw &law;
};

// what fix adapt changes by its name; dashpots only where the command has the keyword damping
double *law_parameter(faultgouge::MindlinLaw &law, const char *name, bool damping);

}    // namespace LAMMPS_NS

#endif
