// fix ID group state/disc
//
// Where the disks are, how they move and what they feel, in one per-atom array, for a driver that reads and writes them
// all at once. Columns: given, x, y, theta, v_x, v_y, omega, f_x, f_y, torque. They are up to date at the end of a run.
// Written from outside (library scatter), with 1 in the first column, coordinates, angle (the per-atom property
// d_theta, if there is one) and velocities count from the next run's setup.

#ifndef LMP_FIX_DISC_STATE_H
#define LMP_FIX_DISC_STATE_H

#include "fix_disk_columns.h"

namespace LAMMPS_NS {

class FixDiscState : public FixDiskColumns {
public:
  FixDiscState(class LAMMPS *, int, char **);

  int setmask() override;
  void setup_pre_exchange() override;
  void post_run() override;

private:
  enum Column { GIVEN, X, Y, THETA, VX, VY, OMEGA, FX, FY, TORQUE, COLUMNS };

  double *angles() const;    // null: there are none
};

}    // namespace LAMMPS_NS

#endif
