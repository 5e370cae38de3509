// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// Integrators of disks in the plane, with moment of inertia I = I0 m R^2.
//
//   fix ID group nve/disc I0 [drag TAU]      velocity Verlet, undamped, or with the drag -(m/TAU) v and -(I/TAU) omega
//   fix ID group overdamped/disc GAMMA I0    v = F/GAMMA, R omega = (T/R)/(GAMMA I0): the relaxation
//                                            of the coordinates (x, y, R theta) by their forces
//   fix ID group displace/disc               moves by v dt and omega dt, whatever the forces
//
// Keywords: with rotation no they leave spins and angles out, since without friction nothing turns a disk; with
// compensated they carry the low parts of coordinates, see pair mindlin/smooth. The drag lets velocities decay by
// exp(-dt/(2 TAU)) before the first half of the kick and after the second (Strang's splitting): of second order in the
// time step, stable for any TAU, and no force, so that restarts need nothing for it.
// Where the input has a per-atom property d_theta (fix property/atom), it takes up the rotation angle.
//
// displace/disc hands out all that a driver wants to know of the disks after a run, in one per-atom array: given, x, y,
// theta, v_x, v_y, omega, f_x, f_y, torque. Written from outside (library scatter) with given = 1, coordinates, angle
// and velocities of a disk count from the next run's begin, also with `pre no`.

#ifndef LMP_FIX_DISC_INTEGRATORS_H
#define LMP_FIX_DISC_INTEGRATORS_H

#include "fix_disk_columns.h"

#include <type_traits>

namespace LAMMPS_NS {

class FixDiscIntegrator : public FixDiskColumns {
public:
  FixDiscIntegrator(class LAMMPS *, int, char **, int numbers, bool takes_drag = false);
  int setmask() override;
  void init() override;
  void setup(int) override;
  void final_integrate() override;
  void reset_dt() override;

  bool compensated() const { return carries_low_parts; }

protected:
  double dt = 0.0;
  double inertia_factor = 1.0;
  double drag_time = 0.0;    // 0: no drag
  const int numbers;         // arguments before the keywords

  double positive_argument(const char *name, const char *text);
  struct Velocity {
    double x, y, spin;
  };

  // LAMMPS's arrays of this rank's disks, whose rows lie one behind the other; found once for a loop over disks
  struct Disks {
    using Row = double[3];
    double dt = 0.0;
    int count = 0;
    Row *x = nullptr, *v = nullptr, *f = nullptr, *omega = nullptr, *torque = nullptr;
    const double *mass = nullptr, *radius = nullptr;
    const int *mask = nullptr;
    double *theta = nullptr;    // null: there are no angles

    template <bool ROTATION> void set_velocity(int i, const Velocity &velocity) const;
  };

  Disks disks() const;
  // by v dt and omega dt
  template <bool ROTATION, bool COMPENSATED> void move(const Disks &disks, int i, const Velocity &velocity);
  void complete_forces();
  void wrap();                                                               // all disks into the periodic box
  [[noreturn]] void stop_at_long_step(int i, double dx, double dy) const;    // disk i cannot move so far
  double *angles() const;                                                    // null: there are none

  // work(rotates, compensates) with both known at compile time
  template <class Work> void dispatch(Work work) const
  {
    using Yes = std::true_type;
    using No = std::false_type;
    if (rotation && low_parts)
      work(Yes(), Yes());
    else if (rotation)
      work(Yes(), No());
    else if (low_parts)
      work(No(), Yes());
    else
      work(No(), No());
  }

private:
  bool rotation = true;
  bool carries_low_parts = false;
  class FixLowParts *low_parts = nullptr;    // null: plain doubles
  int angle = -1;                            // index of d_theta among the custom per-atom vectors, -1: there is none
};

class FixNVEDisc : public FixDiscIntegrator {
public:
  FixNVEDisc(class LAMMPS *, int, char **);
  int setmask() override;
  void initial_integrate(int) override;
  void final_integrate() override;

  void reset_dt() override;

  bool drags() const { return drag_time > 0.0; }

private:
  double kept = 1.0;    // share of a velocity that drag leaves over half a step

  static void decay(Velocity &velocity, double kept);
  // work(i, velocity of disk i, function that adds half a step's forces to a velocity)
  template <bool ROTATION, class Work> void for_each_disk(const Disks &disks, Work work) const;
  // work(rotates, compensates, drags) with all known at compile time
  template <class Work> void dispatch_with_drag(Work work) const;
};

class FixDisplaceDisc : public FixDiscIntegrator {
public:
  FixDisplaceDisc(class LAMMPS *, int, char **);
  int setmask() override;
  void init() override;
  void initial_integrate(int) override;
  void post_run() override;

private:
  bool read_given_state();    // true if there was any

  enum Column { GIVEN, X, Y, THETA, VX, VY, OMEGA, FX, FY, TORQUE, COLUMNS };
};

class FixOverdampedDisc : public FixDiscIntegrator {
public:
  FixOverdampedDisc(class LAMMPS *, int, char **);
  void initial_integrate(int) override;

private:
  double damping;
};

}    // namespace LAMMPS_NS

#endif
