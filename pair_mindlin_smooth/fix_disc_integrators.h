// Integrators of disks in the plane, with moment of inertia I = I0 m R^2.
//
//   fix ID group nve/disc I0 [rotation no]                 velocity Verlet, undamped
//   fix ID group overdamped/disc GAMMA I0 [rotation no]    v = F/GAMMA, R omega = (T/R)/(GAMMA I0): the relaxation
//                                                          of the coordinates (x, y, R theta) by their forces
//
// Without friction nothing turns a disk: rotation no leaves spins and angles out.
// Where the input has a per-atom property d_theta (fix property/atom), it takes up the rotation angle.

#ifndef LMP_FIX_DISC_INTEGRATORS_H
#define LMP_FIX_DISC_INTEGRATORS_H

#include "fix.h"

namespace LAMMPS_NS {

class FixDiscIntegrator : public Fix {
public:
  FixDiscIntegrator(class LAMMPS *, int, char **);
  int setmask() override;
  void init() override;
  void reset_dt() override;

protected:
  double dt = 0.0;
  double inertia_factor = 1.0;
  bool rotation = true;

  double positive_argument(const char *name, const char *text);
  void keywords(int narg, char **arg);
  template <bool ROTATION> void move(int i);    // by v dt and omega dt

private:
  int angle = -1;    // index of d_theta among the custom per-atom vectors, -1: there is none
};

class FixNVEDisc : public FixDiscIntegrator {
public:
  FixNVEDisc(class LAMMPS *, int, char **);
  int setmask() override;
  void initial_integrate(int) override;
  void final_integrate() override;

private:
  template <bool ROTATION> void kick(int i);    // by half a step
  template <bool ROTATION> void kick_and_move();
  template <bool ROTATION> void kick_all();
};

class FixOverdampedDisc : public FixDiscIntegrator {
public:
  FixOverdampedDisc(class LAMMPS *, int, char **);
  void initial_integrate(int) override;

private:
  double damping;

  template <bool ROTATION> void relax();
};

}    // namespace LAMMPS_NS

#endif
