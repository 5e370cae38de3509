// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// Sums of doubles without a rounding, which do not depend on the order of what is added: integers of 64 bits, each for
// 32 bits of a fixed-point number that spans all doubles. Integers of several ranks are added by one reduction.
//
// U. Kulisch, Computer Arithmetic and Validity, de Gruyter 2013, section 8.

#ifndef FAULTGOUGE_EXACT_ACCUMULATOR_H
#define FAULTGOUGE_EXACT_ACCUMULATOR_H

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

namespace faultgouge {

class ExactAccumulator {
public:
  static constexpr int LIMBS = 67;    // 2046 exponents in limbs of 32 bits, the mantissa's width, and the carry
  static constexpr int SIZE = LIMBS + 2;

  // fewer than 2^29 numbers
  void add(double number)
  {
    std::uint64_t bits;
    std::memcpy(&bits, &number, sizeof(bits));
    const int exponent = static_cast<int>(bits >> 52) & 0x7ff;
    whole[COUNT]++;
    if (exponent == 0x7ff) {
      whole[NOT_FINITE]++;
      return;
    }
    const std::uint64_t mantissa = (bits & ((std::uint64_t(1) << 52) - 1)) | (std::uint64_t(exponent > 0) << 52);
    const int place = exponent > 0 ? exponent - 1 : 0, limb = place >> 5, shift = place & 31;
    const std::uint64_t low = (mantissa & MASK) << shift, high = (mantissa >> 32) << shift;
    const std::int64_t sign = bits >> 63 ? -1 : 1;
    whole[limb] += sign * static_cast<std::int64_t>(low & MASK);
    whole[limb + 1] += sign * static_cast<std::int64_t>((low >> 32) + (high & MASK));
    whole[limb + 2] += sign * static_cast<std::int64_t>(high >> 32);
  }

  // a difference has the sum of what was added less what is subtracted, and no mean
  void subtract(const ExactAccumulator &other)
  {
    for (int k = 0; k < SIZE; k++) whole[k] -= other.whole[k];
  }

  std::int64_t *integers() { return whole.data(); }    // SIZE of them, for a reduction

  // of all that was added, to the last place; NaN if one was not finite, 0 without any
  double mean() const
  {
    if (whole[NOT_FINITE] > 0) return std::numeric_limits<double>::quiet_NaN();
    if (whole[COUNT] == 0) return 0.0;
    return sum() / static_cast<double>(whole[COUNT]);
  }

  double sum() const
  {
    int first = 0, last = LIMBS - 1;    // of what is not 0
    while (first < last && whole[first] == 0) first++;
    while (last > first && whole[last] == 0) last--;
    const int end = std::min(last + 1, LIMBS - 1);
    std::array<std::int64_t, LIMBS> digits;
    const bool negative = carry(1, first, end, digits) < 0;
    if (negative) carry(-1, first, end, digits);
    int top = end;
    while (top > first && digits[top] == 0) top--;
    const auto digit = [&](int k) { return k >= first ? static_cast<double>(digits[k]) : 0.0; };
    const double leading = digit(top) * 0x1p64 + (digit(top - 1) * 0x1p32 + digit(top - 2));
    const double size = std::ldexp(leading, 32 * (top - 2) - 1074);
    return negative ? -size : size;
  }

private:
  static constexpr std::uint64_t MASK = 0xffffffff;
  enum { COUNT = LIMBS, NOT_FINITE };
  std::array<std::int64_t, SIZE> whole{};

  // digits of sign times the sum from the first to the end, beside which all are 0: all below 2^32 and not negative but
  // for the last one, which is returned
  std::int64_t carry(std::int64_t sign, int first, int end, std::array<std::int64_t, LIMBS> &digits) const
  {
    std::int64_t over = 0;
    for (int k = first; k < end; k++) {
      const std::int64_t number = sign * whole[k] + over;
      digits[k] = number & static_cast<std::int64_t>(MASK);
      over = (number - digits[k]) / (std::int64_t(1) << 32);
    }
    return digits[end] = sign * whole[end] + over;
  }
};

}    // namespace faultgouge

#endif
