// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// Sums of two doubles, and coordinates on a fixed grid. No LAMMPS types.
//
// A coordinate of order 10 is known to 1e-15, an overlap of 4e-4 that is the difference of two such numbers
// to 11 digits, and the net force of a disk, at k_n = 2e5, to 1e-11. Two things take this away.
//
//   Compensated      an unevaluated sum high + low with about 100 bits. Sums and products keep the error of
//                    the leading operation (Knuth, Dekker); the low part itself is in plain arithmetic and
//                    the sum is not normalized, which a short chain of operations does not need.
//   FixedPointGrid   a coordinate as a multiple of g plus a low part within g/2, a multiple of 2^-52 g. As g
//                    is 2^-26 of the largest reach of a contact, rounded up to a power of two, differences of
//                    coordinates are exact, and so are the squares of the high parts of a contact's branch.
//   SummationGrid    numbers as a multiple of G plus a multiple of 2^-48 G: sums of both parts are exact, and so do
//                    not depend on the order of the summands.

#ifndef FAULTGOUGE_COMPENSATED_H
#define FAULTGOUGE_COMPENSATED_H

#include <cmath>

// Into functions that are compiled for another processor GCC inlines no other functions than these.
#define FAULTGOUGE_INLINED __attribute__((always_inline))
#define FAULTGOUGE_INLINE inline FAULTGOUGE_INLINED

namespace faultgouge {

struct Compensated {
  double high = 0.0, low = 0.0;

  FAULTGOUGE_INLINE Compensated() = default;
  FAULTGOUGE_INLINE Compensated(double value) : high(value) {}
  FAULTGOUGE_INLINE Compensated(double h, double l) : high(h), low(l) {}
};

FAULTGOUGE_INLINE double value(double a)
{
  return a;
}
FAULTGOUGE_INLINE double value(Compensated a)
{
  return a.high + a.low;
}
FAULTGOUGE_INLINE double leading(double a)
{
  return a;
}
FAULTGOUGE_INLINE double leading(Compensated a)
{
  return a.high;
}

// a + b, exactly
FAULTGOUGE_INLINE Compensated exact_sum(double a, double b)
{
  const double sum = a + b, part = sum - a;
  return {sum, (a - (sum - part)) + (b - part)};
}

// the same where |a| >= |b|; in plain arithmetic there is nothing to keep
FAULTGOUGE_INLINE double ordered_sum(double a, double b)
{
  return a + b;
}

FAULTGOUGE_INLINE Compensated ordered_sum(double a, Compensated b)
{
  const double sum = a + b.high;
  return {sum, (b.high - (sum - a)) + b.low};
}

// a b, exactly
FAULTGOUGE_INLINE Compensated exact_product(double a, double b)
{
  const double product = a * b;
  return {product, __builtin_fma(a, b, -product)};
}

// the same number with the high part the closest double
FAULTGOUGE_INLINE Compensated normalized(Compensated a)
{
  const double sum = a.high + a.low;
  return {sum, a.low - (sum - a.high)};
}

FAULTGOUGE_INLINE Compensated operator-(Compensated a)
{
  return {-a.high, -a.low};
}

FAULTGOUGE_INLINE Compensated operator+(Compensated a, Compensated b)
{
  const Compensated sum = exact_sum(a.high, b.high);
  return {sum.high, sum.low + (a.low + b.low)};
}

FAULTGOUGE_INLINE Compensated operator-(Compensated a, Compensated b)
{
  return a + -b;
}

// without the product of the low parts: only one of the two may be far from normalized
FAULTGOUGE_INLINE Compensated operator*(Compensated a, Compensated b)
{
  const Compensated product = exact_product(a.high, b.high);
  return {product.high, __builtin_fma(a.high, b.low, __builtin_fma(a.low, b.high, product.low))};
}

FAULTGOUGE_INLINE Compensated operator*(double a, Compensated b)
{
  const Compensated product = exact_product(a, b.high);
  return {product.high, __builtin_fma(a, b.low, product.low)};
}

FAULTGOUGE_INLINE Compensated operator/(Compensated a, Compensated b)
{
  const double inverse = 1.0 / b.high, quotient = a.high * inverse;
  const double rest = __builtin_fma(-quotient, b.high, a.high) + __builtin_fma(-quotient, b.low, a.low);
  return {quotient, rest * inverse};
}

struct RootAndInverse {
  Compensated root, inverse;
};

// the square root of a normalized number and the inverse of the root, with one division
FAULTGOUGE_INLINE RootAndInverse root_and_inverse(Compensated a)
{
  const double root = std::sqrt(a.high), inverse = 1.0 / root;
  const double low = (__builtin_fma(-root, root, a.high) + a.low) * (0.5 * inverse);
  return {{root, low}, {inverse, (__builtin_fma(-inverse, root, 1.0) - inverse * low) * inverse}};
}

// a^(3/2) of a normalized number: with root^2 = a.high - rest it is a.high root + root (rest/2 + 3/2 a.low), up to
// terms of second order
FAULTGOUGE_INLINE Compensated three_halves_power(Compensated a)
{
  const double root = std::sqrt(a.high), rest = __builtin_fma(-root, root, a.high);
  const Compensated product = exact_product(a.high, root);
  return {product.high, __builtin_fma(root, __builtin_fma(1.5, a.low, 0.5 * rest), product.low)};
}

FAULTGOUGE_INLINE Compensated fabs(Compensated a)
{
  const double sign = std::copysign(1.0, a.high);
  return {sign * a.high, sign * a.low};
}

FAULTGOUGE_INLINE bool operator<(Compensated a, Compensated b)
{
  return a.high - b.high < b.low - a.low;
}

// a number times 1 or -1
FAULTGOUGE_INLINE double times_sign(double a, double sign)
{
  return a * sign;
}

FAULTGOUGE_INLINE Compensated times_sign(Compensated a, double sign)
{
  return {a.high * sign, a.low * sign};
}

// without a branch, so that loops over contacts can be vectorized
FAULTGOUGE_INLINE double select(bool condition, double a, double b)
{
  return condition ? a : b;
}

FAULTGOUGE_INLINE Compensated select(bool condition, Compensated a, Compensated b)
{
  return {condition ? a.high : b.high, condition ? a.low : b.low};
}

struct FixedPointGrid {
  double spacing = 0.0;    // g

  static FixedPointGrid for_reach(double reach)
  {
    int exponent;
    std::frexp(reach, &exponent);    // reach < 2^exponent
    return {std::ldexp(1.0, exponent - 26)};
  }

  // the closest multiple of g
  FAULTGOUGE_INLINE double to_spacing(double a) const
  {
    const double shift = 0x1.8p52 * spacing;
    return (a + shift) - shift;
  }

  // the closest multiple of 2^-52 g, for |a| <= g/2
  FAULTGOUGE_INLINE double to_finest(double a) const { return (a + 1.5 * spacing) - 1.5 * spacing; }

  // a coordinate, with its high part a multiple of g again, after it has moved by d, which is rounded to 2^-52 g first:
  // all that follows is exact, however the coordinate was divided into high and low part before
  FAULTGOUGE_INLINE Compensated displace(Compensated x, double d) const
  {
    const double step = to_spacing(d), rest = x.low + to_finest(d - step), carry = to_spacing(rest);
    return {x.high + (step + carry), rest - carry};
  }

  // any coordinate as a multiple of g and a rest that is a multiple of 2^-52 g
  FAULTGOUGE_INLINE Compensated split(Compensated x) const
  {
    const double high = to_spacing(x.high);
    return displace(displace({high, 0.0}, x.high - high), x.low);
  }
};

struct SummationGrid {
  FixedPointGrid high, low;

  // G is 2^-50 of a power of two above the largest summand: sums of high parts are exact up to eight times that power,
  // those of low parts, each within G/2, for up to 64 summands. What is rounded off is 2^-99 of the power.
  static SummationGrid for_largest(double summand)
  {
    int exponent;
    std::frexp(summand, &exponent);    // summand < 2^exponent
    return {{std::ldexp(1.0, exponent - 50)}, {std::ldexp(1.0, exponent - 98)}};
  }

  // however the number was divided into high and low part before
  FAULTGOUGE_INLINE Compensated round_to_grids(Compensated x) const
  {
    const double leading_part = high.to_spacing(x.high + x.low);
    return {leading_part, low.to_spacing((x.high - leading_part) + x.low)};
  }
};

}    // namespace faultgouge

#endif
