// Low parts of coordinates and forces: fix low/parts, made by pair mindlin/smooth with the keyword compensated.
//
// Columns of the per-atom array: x, y (what the coordinates in x lack, see compensated.h), f_x, f_y, torque (what
// the forces in f and torque lack while a step is under way). A coordinate written from outside (data file,
// library scatter) is split at the next run's setup. Disks are wrapped into a periodic box here, before
// LAMMPS does so with a rounding.

#ifndef LMP_FIX_LOW_PARTS_H
#define LMP_FIX_LOW_PARTS_H

#include "atom.h"
#include "compensated.h"
#include "fix.h"

namespace LAMMPS_NS {

class FixLowParts : public Fix {
public:
  static constexpr const char *ID = "low";
  enum Column { X, Y, FX, FY, TORQUE, COLUMNS };

  FixLowParts(class LAMMPS *, int, char **);
  ~FixLowParts() override;

  int setmask() override;
  void setup_pre_exchange() override;
  void pre_exchange() override;

  void set_reach(double largest);    // of a contact
  const faultgouge::FixedPointGrid &grid() const { return spacing; }
  double period(int dimension) const;        // length of the box as a multiple of the grid
  double period_low(int dimension) const;    // and the rest
  void move(int i, double dx, double dy)
  {
    double *const high = atom->x[i], *const low = array_atom[i];
    const faultgouge::Compensated x = spacing.moved({high[0], low[X]}, dx), y = spacing.moved({high[1], low[Y]}, dy);
    high[0] = x.high;
    high[1] = y.high;
    low[X] = x.low;
    low[Y] = y.low;
  }
  void complete_forces();    // by their low parts

  void grow_arrays(int) override;
  void copy_arrays(int, int, int) override;
  void set_arrays(int) override;
  int pack_exchange(int, double *) override;
  int unpack_exchange(int, double *) override;
  int pack_restart(int, double *) override;
  void unpack_restart(int, int) override;
  int size_restart(int) override;
  int maxsize_restart() override;
  double memory_usage() override;

private:
  faultgouge::FixedPointGrid spacing;
  int nmax = 0;

  void wrap(int i, int dimension);
};

}    // namespace LAMMPS_NS

#endif
