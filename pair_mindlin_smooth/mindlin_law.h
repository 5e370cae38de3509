// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// The contact law of two disks, and of a disk on the floor. No LAMMPS types.
//
// n points from j to i and tau = z x n; overlap delta > 0; slip s along tau; the exponent p is one of `Exponents`.
//
//   normal force on i      f_n = k_n delta^p
//   tangential force on i  f_t = -k_t delta^(p-1) (1 + x - x^2) s,  x = |s|/s*,  s* = mu (k_n/k_t) delta
//   dashpots               -C_N delta^(p-1) (n . v_ij) along n,  -C_T delta^(p-1) ds/dt along tau
//
// The tangential force is evaluated as -sign(s) mu f_n (x + x^2 - x^3), the same expression, because it
// never exceeds mu f_n, not even by a rounding, and equals it at x = 1. With a dashpot it is cut off at mu f_n, where
// f_n is the elastic force. Numbers are double or Compensated; velocities, and so the forces of dashpots, are double.
//
// Rescaled, the slip becomes s (delta_old/delta_new)^(p-1) while the overlap grows, and stays while it falls, for every
// p > 1. Growth of a contact then adds no tangential force to what the contact carries.
//
// Coulomb's slider behind a spring (Cundall and Strack) has f_t = -k_t delta^(p-1) s up to the bound, with rescaled
// slips. Its slip is -f_t/(k_t delta^(p-1)), the elastic part of the displacement.
//
// analysis/packing/law.py says the same in Python. See docs/howto_law.md for how to add another.

#ifndef FAULTGOUGE_MINDLIN_LAW_H
#define FAULTGOUGE_MINDLIN_LAW_H

#include "compensated.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

namespace faultgouge {

struct Vector {
  double x, y;
};

// what a contact remembers: the whole slip, the slip rescaled while the overlap grows, or the stretch of a spring that
// pulls Coulomb's slider
enum class History { TOTAL, RESCALED, COULOMB };

// A power of the overlap delta, p = EXPONENT. A law of another exponent is one more of these, in `Exponents`: code that
// lacks one of its members does not compile.
struct Hertz {
  static constexpr double EXPONENT = 1.5;
  // delta^(p-1)
  static FAULTGOUGE_INLINE double growth(double overlap) { return std::sqrt(overlap); }
  // k_n delta^p
  static FAULTGOUGE_INLINE double force(double kn, double overlap) { return kn * overlap * std::sqrt(overlap); }
  static FAULTGOUGE_INLINE Compensated force(double kn, Compensated overlap)
  {
    return kn * three_halves_power(overlap);
  }
  // 1 - (1 - share)^(p-1): what is lost of a rescaled slip while the overlap grows by a share of its last value
  static FAULTGOUGE_INLINE double lost(double share) { return share / (1.0 + std::sqrt(1.0 - share)); }
};

struct Harmonic {
  static constexpr double EXPONENT = 1.0;
  static FAULTGOUGE_INLINE double growth(double) { return 1.0; }
  static FAULTGOUGE_INLINE double force(double kn, double overlap) { return kn * overlap; }
  static FAULTGOUGE_INLINE Compensated force(double kn, Compensated overlap) { return kn * overlap; }
  static FAULTGOUGE_INLINE double lost(double) { return 0.0; }
};

// The place of a power in the list stands for it while the program runs, and in restart files.
template <class First, class... Rest> struct PowerList {
  // work(power) with the power at a place
  template <class Work> static FAULTGOUGE_INLINE auto at(int place, const Work &work)
  {
    if constexpr (sizeof...(Rest) > 0)
      if (place > 0) return PowerList<Rest...>::at(place - 1, work);
    return work(First());
  }
  static constexpr int SIZE = 1 + sizeof...(Rest);
};

using Exponents = PowerList<Hertz, Harmonic>;

struct MindlinLaw {
  double kn = 0.0, kt = 0.0, mu = 0.0;
  double cn = 0.0, ct = 0.0;
  int exponent = 0;    // its place in `Exponents`
  History history = History::TOTAL;

  bool frictional() const { return mu > 0.0 && kt > 0.0; }
  bool valid() const
  {
    return std::isfinite(kn) && std::isfinite(kt) && std::isfinite(mu) && kn > 0.0 && kt >= 0.0 && mu >= 0.0;
  }
  // below this exponent the smoothed force creates energy with rescaled slips, too
  static constexpr double LEAST_RESCALED = 1.4;
  double power() const
  {
    return Exponents::at(exponent, [](auto p) { return p.EXPONENT; });
  }
  bool valid_history() const { return history != History::RESCALED || power() >= LEAST_RESCALED; }
  bool rescales() const { return history != History::TOTAL && power() > 1.0; }
  bool valid_dashpots() const { return std::isfinite(cn) && std::isfinite(ct) && cn >= 0.0 && ct >= 0.0; }

  // false: there is no such exponent
  bool set_exponent(double p)
  {
    for (exponent = 0; exponent < Exponents::SIZE; exponent++)
      if (power() == p) return true;
    exponent = 0;
    return false;
  }

  // false: there is no such history
  bool set_history(const char *name)
  {
    const bool rescaled = std::strcmp(name, "rescaled") == 0, coulomb = std::strcmp(name, "coulomb") == 0;
    history = rescaled ? History::RESCALED : coulomb ? History::COULOMB : History::TOTAL;
    return rescaled || coulomb || std::strcmp(name, "total") == 0;
  }

  // slip at which the tangential force reaches the Coulomb limit, per unit overlap
  template <class Number> FAULTGOUGE_INLINE Number slip_limit_ratio() const
  {
    return Number(mu) * Number(kn) / Number(kt);
  }

  template <class P, class Number> FAULTGOUGE_INLINE Number normal_force(Number overlap) const
  {
    return P::force(kn, overlap);
  }

  // Where friction has weakened to nothing slip_limit is zero, and so is the bound.
  template <bool SLIDER, class Number>
  FAULTGOUGE_INLINE Number tangential_force(Number normal, Number slip, Number slip_limit) const
  {
    using std::fabs;
    const Number size = fabs(slip), one = 1.0;
    const Number x = select(size < slip_limit, size / slip_limit, one);
    const Number share = SLIDER ? x : x * ordered_sum(1.0, x * ordered_sum(1.0, -x));
    return times_sign(mu * normal * share, -std::copysign(1.0, leading(slip)));
  }
  template <class Number> FAULTGOUGE_INLINE Number tangential_force(Number normal, Number slip, Number slip_limit) const
  {
    if (history == History::COULOMB) return tangential_force<true>(normal, slip, slip_limit);
    return tangential_force<false>(normal, slip, slip_limit);
  }

  // f_n with the dashpot's force while n . v_ij is so large
  template <class P, class Number>
  FAULTGOUGE_INLINE Number damped_normal(Number normal, double overlap, double rate) const
  {
    return normal - Number(cn * P::growth(overlap) * rate);
  }

  // f_t with the dashpot's force while the slip grows at a rate, within the bound of the elastic normal force
  template <class P, class Number>
  FAULTGOUGE_INLINE Number damped_tangential(Number tangential, Number normal, double overlap, double rate) const
  {
    using std::fabs;
    const Number sum = tangential - Number(ct * P::growth(overlap) * rate), bound = mu * normal;
    return select(fabs(sum) < bound, sum, times_sign(bound, std::copysign(1.0, leading(sum))));
  }

  // power that dashpots take at rates of opening and of slip, with the elastic normal force and both tangential ones:
  // beyond the bound they take as much as the bound leaves them
  template <class P>
  FAULTGOUGE_INLINE double dashpot_power(double overlap, double opening, double slip_rate, double elastic_tangential,
                                         double tangential) const
  {
    return cn * P::growth(overlap) * opening * opening + (elastic_tangential - tangential) * slip_rate;
  }

  // the same with the exponent looked up, for what is not done in every step
  double growth(double overlap) const
  {
    return Exponents::at(exponent, [&](auto p) { return p.growth(overlap); });
  }
  double normal_force(double overlap) const
  {
    return Exponents::at(exponent, [&](auto p) { return p.force(kn, overlap); });
  }
  // k_n delta^(p+1) / (p+1)
  double normal_energy(double overlap) const { return 1.0 / (power() + 1.0) * normal_force(overlap) * overlap; }
  double damped_normal(double normal, double overlap, double rate) const
  {
    return Exponents::at(exponent, [&](auto p) { return damped_normal<decltype(p)>(normal, overlap, rate); });
  }
  double damped_tangential(double tangential, double normal, double overlap, double rate) const
  {
    return Exponents::at(exponent,
                         [&](auto p) { return damped_tangential<decltype(p)>(tangential, normal, overlap, rate); });
  }
  double rescaled_increment(double slip, double increment, double change, double overlap) const;
};

// Slip of a contact while its branch vector moves by d to r: d along the tangent at the middle of the
// step, tau_mid = z x (r - d/2)/|r - d/2|, for which (r - d/2) drops out of the numerator. The tangent at
// the end of the step would make the slip first order in d only.
FAULTGOUGE_INLINE double midpoint_slip(Vector r, Vector d)
{
  const double mx = r.x - 0.5 * d.x, my = r.y - 0.5 * d.y;
  return (r.x * d.y - r.y * d.x) / std::sqrt(mx * mx + my * my);
}

// Change of the overlap while the branch vector moves by d to r: with |r|^2 - |r - d|^2 = d . (2r - d) no digits of a
// small displacement are lost.
FAULTGOUGE_INLINE double overlap_change(Vector r, Vector d)
{
  const double ox = r.x - d.x, oy = r.y - d.y;
  const double both = std::sqrt(r.x * r.x + r.y * r.y) + std::sqrt(ox * ox + oy * oy);
  return -(d.x * (r.x + ox) + d.y * (r.y + oy)) / both;
}

// What a rescaled slip gains while a contact slips by an increment and its overlap changes by some length to a positive
// overlap. With the ratio q <= 1 of the stiffnesses before and after, the new slip is q s and (1 + q)/2 times the
// increment, as the trapezoidal rule has it.
template <class P>
FAULTGOUGE_INLINE double rescaled_increment(double slip, double increment, double change, double overlap)
{
  const double share = std::min(std::max(change / overlap, 0.0), 1.0);
  const double loss = P::lost(share);    // 1 - q
  return (1.0 - 0.5 * loss) * increment - loss * slip;
}

inline double MindlinLaw::rescaled_increment(double slip, double increment, double change, double overlap) const
{
  return Exponents::at(
      exponent, [&](auto p) { return faultgouge::rescaled_increment<decltype(p)>(slip, increment, change, overlap); });
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
