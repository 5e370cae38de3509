// The contact law of two disks, and of a disk on the floor. No LAMMPS types.
//
// n points from j to i and tau = z x n; overlap delta > 0; slip s along tau.
//
//   normal force on i      f_n = k_n delta^(3/2)
//   tangential force on i  f_t = -k_t delta^(1/2) (1 + x - x^2) s,  x = |s|/s*,  s* = mu (k_n/k_t) delta
//
// The tangential force is evaluated as -sign(s) mu f_n (x + x^2 - x^3), the same expression, because it
// never exceeds mu f_n, not even by a rounding, and equals it at x = 1. Numbers are double or Compensated.

#ifndef FAULTGOUGE_MINDLIN_LAW_H
#define FAULTGOUGE_MINDLIN_LAW_H

#include "compensated.h"

#include <algorithm>
#include <cmath>

namespace faultgouge {

struct Vector {
  double x, y;
};

struct MindlinLaw {
  double kn = 0.0, kt = 0.0, mu = 0.0;

  bool frictional() const { return mu > 0.0 && kt > 0.0; }
  bool valid() const
  {
    return std::isfinite(kn) && std::isfinite(kt) && std::isfinite(mu) && kn > 0.0 && kt >= 0.0 && mu >= 0.0;
  }

  // slip at which the tangential force reaches the Coulomb limit, per unit overlap
  template <class Number> FAULTGOUGE_INLINE Number slip_limit_ratio() const
  {
    return Number(mu) * Number(kn) / Number(kt);
  }

  FAULTGOUGE_INLINE double normal_force(double overlap) const { return kn * overlap * std::sqrt(overlap); }
  FAULTGOUGE_INLINE Compensated normal_force(Compensated overlap) const { return kn * three_halves_power(overlap); }

  double normal_energy(double overlap) const { return 0.4 * normal_force(overlap) * overlap; }

  // Where friction has weakened to nothing slip_limit is zero, and so is the bound.
  template <class Number> FAULTGOUGE_INLINE Number tangential_force(Number normal, Number slip, Number slip_limit) const
  {
    using std::fabs;
    const Number size = fabs(slip), one = 1.0;
    const Number x = select(size < slip_limit, size / slip_limit, one);
    const Number smooth = x * ordered_sum(1.0, x * ordered_sum(1.0, -x));
    return times_sign(mu * normal * smooth, -std::copysign(1.0, leading(slip)));
  }
};

// Slip of a contact while its branch vector moves by d to r: d along the tangent at the middle of the
// step, tau_mid = z x (r - d/2)/|r - d/2|, for which (r - d/2) drops out of the numerator. The tangent at
// the end of the step would make the slip first order in d only.
FAULTGOUGE_INLINE double midpoint_slip(Vector r, Vector d)
{
  const double mx = r.x - 0.5 * d.x, my = r.y - 0.5 * d.y;
  return (r.x * d.y - r.y * d.x) / std::sqrt(mx * mx + my * my);
}

// the slip after an increment, within [-limit, limit]
FAULTGOUGE_INLINE double advanced_slip(double slip, double increment, double limit)
{
  return std::min(std::max(slip + increment, -limit), limit);
}

FAULTGOUGE_INLINE Compensated advanced_slip(Compensated slip, double increment, Compensated limit)
{
  const Compensated sum = exact_sum(slip.high, increment);
  const Compensated moved = normalized({sum.high, sum.low + slip.low});
  return select(fabs(moved) < limit, moved, times_sign(limit, std::copysign(1.0, moved.high)));
}

}    // namespace faultgouge

#endif
