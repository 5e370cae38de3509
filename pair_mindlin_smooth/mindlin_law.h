// The contact law of two disks, and of a disk on the floor. No LAMMPS types.
//
// n points from j to i and tau = z x n; overlap delta > 0; slip s along tau.
//
//   normal force on i      f_n = k_n delta^(3/2)
//   tangential force on i  f_t = -k_t delta^(1/2) (1 + x - x^2) s,  x = |s|/s*,  s* = mu (k_n/k_t) delta
//
// The tangential force is evaluated as -sign(s) mu f_n (x + x^2 - x^3), the same expression, because it
// never exceeds mu f_n, not even by a rounding, and equals it at x = 1.

#ifndef FAULTGOUGE_MINDLIN_LAW_H
#define FAULTGOUGE_MINDLIN_LAW_H

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
  double slip_limit_ratio() const { return mu * kn / kt; }

  double normal_force(double overlap) const { return kn * overlap * std::sqrt(overlap); }
  double normal_energy(double overlap) const { return 0.4 * normal_force(overlap) * overlap; }

  double tangential_force(double normal, double slip, double slip_limit) const
  {
    if (slip_limit == 0.0) return 0.0;    // friction may weaken to nothing
    const double x = std::min(std::fabs(slip) / slip_limit, 1.0);
    return -std::copysign(mu * normal * (x * (1.0 + x * (1.0 - x))), slip);
  }
};

// Slip of a contact while its branch vector moves by d to r: d along the tangent at the middle of the
// step, tau_mid = z x (r - d/2)/|r - d/2|, for which (r - d/2) drops out of the numerator. The tangent at
// the end of the step would make the slip first order in d only.
inline double midpoint_slip(Vector r, Vector d)
{
  const double mx = r.x - 0.5 * d.x, my = r.y - 0.5 * d.y;
  return (r.x * d.y - r.y * d.x) / std::sqrt(mx * mx + my * my);
}

inline double clamp_slip(double slip, double limit)
{
  return std::min(std::max(slip, -limit), limit);
}

}    // namespace faultgouge

#endif
