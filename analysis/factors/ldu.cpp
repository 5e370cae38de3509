// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-or-later
//
// This file is free software under the terms of the GNU General Public License, version 2 or later; see LICENSE.

// Factors L D U of a sparse matrix without pivoting, and solutions with them, see sparse_lu.py. L and U^T have the
// pattern that they would have if A had the entries of A + A^T.
//
// A symmetric matrix has one half, its lower one: U is L^T. Of any other matrix the transpose has the other half.
//
// No fused multiply-add (-ffp-contract=off): results are then the same to the bit on every machine.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

#if defined(__x86_64__) && defined(__GLIBC__)    // where the loader chooses between versions
#define EVERY_MACHINE __attribute__((target_clones("avx2", "default")))
#else
#define EVERY_MACHINE
#endif
#define INLINE inline __attribute__((always_inline))
#define EXPORTED extern "C" __attribute__((visibility("default")))

namespace {

// Of A, both halves; or of L, which is lower triangular with ones on its diagonal, what is below the diagonal.
struct Columns {
  int32_t size;
  const int64_t *start;
  const int32_t *row;
  const double *value;

  int32_t count(int32_t column) const { return static_cast<int32_t>(start[column + 1] - start[column]); }
};

// The dense fronts of the halves of a matrix, by columns, whose upper halves are not used.
struct Fronts {
  double *half[2];
  int halves;
  int64_t rows;
};

// Takes K neighbouring columns, which have become those of L D, out of the columns from `from` to `end` of a half.
template <int K>
INLINE void take_out(const Fronts &fronts, int half, int32_t first, const double *pivot, int32_t from, int32_t end)
{
  const int64_t rows = fronts.rows;
  const double *taken = fronts.half[half] + first * rows, *other = fronts.half[fronts.halves - 1 - half] + first * rows;
  for (int32_t j = from; j < end; ++j) {
    double *column = fronts.half[half] + j * rows, factor[K];
    for (int k = 0; k < K; ++k) factor[k] = other[k * rows + j] / pivot[first + k];
    for (int64_t i = j; i < rows; ++i) {
      double sum = 0.0;
      for (int k = 0; k < K; ++k) sum += factor[k] * taken[k * rows + i];
      column[i] -= sum;
    }
  }
}

// Eliminates the first columns of a front, as many as it has pivots, a panel that stays in the cache at a time.
EVERY_MACHINE void eliminate(const Fronts &fronts, int32_t pivots, double *pivot)
{
  constexpr int32_t PANEL = 48;
  for (int32_t begin = 0; begin < pivots; begin += PANEL) {
    const int32_t end = std::min(begin + PANEL, pivots);
    for (int32_t k = begin; k < end; ++k) {
      pivot[k] = fronts.half[0][k * (fronts.rows + 1)];
      for (int half = 0; half < fronts.halves; ++half) take_out<1>(fronts, half, k, pivot, k + 1, end);
    }
    for (int half = 0; half < fronts.halves; ++half)
      for (int32_t j = end; j < fronts.rows; ++j) {
        int32_t k = begin;
        for (; k + 6 <= end; k += 6) take_out<6>(fronts, half, k, pivot, j, j + 1);
        for (; k + 3 <= end; k += 3) take_out<3>(fronts, half, k, pivot, j, j + 1);    // the coordinates of a disk
        for (; k < end; ++k) take_out<1>(fronts, half, k, pivot, j, j + 1);
      }
  }
}

// A supernode, neighbouring columns of L of one pattern, is eliminated in a dense front. What that leaves for the rows
// below, its update, waits until the front of its parent in the elimination tree is assembled.
class Multifrontal {
public:
  // A, or A^T, of which the lower half counts, and the same half of the factors.
  struct Half {
    Columns given;
    double *made;
    std::vector<double> front;
    std::vector<std::vector<double>> update;    // by last column: the lower half, by columns
  };

  Multifrontal(const int32_t *parent, const Columns &lower, int32_t *row, std::vector<Half> &halves, double *pivot) :
      parent(parent),
      lower(lower),
      row(row),
      halves(halves),
      pivot(pivot),
      place(lower.size),
      seen(lower.size, -1),
      child(lower.size, -1),
      sibling(lower.size, -1)
  {
    for (Half &half : halves) half.update.resize(lower.size);
  }

  // Whether all pivots were other than zero.
  bool factor()
  {
    for (int32_t first = 0, next; first < lower.size; first = next) {
      next = first + 1;
      while (next < lower.size && parent[next - 1] == next && lower.count(next - 1) == lower.count(next) + 1) ++next;
      find_rows(first, next);
      for (Half &half : halves) assemble(half, first, next);
      const Fronts fronts = {{halves.front().front.data(), halves.back().front.data()},
                             static_cast<int>(halves.size()),
                             static_cast<int64_t>(rows.size())};
      eliminate(fronts, next - first, pivot + first);
      if (std::find(pivot + first, pivot + next, 0.0) != pivot + next) return false;
      for (Half &half : halves) store(half, first, next);
      if (static_cast<int32_t>(rows.size()) > next - first) {
        sibling[next - 1] = child[parent[next - 1]];
        child[parent[next - 1]] = next - 1;
      }
    }
    return true;
  }

private:
  const int32_t *parent;
  const Columns &lower;
  int32_t *row;
  std::vector<Half> &halves;
  double *pivot;
  std::vector<int32_t> rows, place, seen;    // of the front; where they are in it; which front saw them last
  std::vector<int32_t> child, sibling;       // last columns of supernodes
  std::vector<int32_t> there;

  double *column(Half &half, int64_t number) { return half.front.data() + number * static_cast<int64_t>(rows.size()); }

  void find_rows(int32_t first, int32_t next)
  {
    rows.clear();
    const auto see = [&](const Columns &columns, int32_t j) {
      for (int64_t p = columns.start[j]; p < columns.start[j + 1]; ++p) {
        const int32_t i = columns.row[p];
        if (i < next || seen[i] == first) continue;
        seen[i] = first;
        rows.push_back(i);
      }
    };
    for (int32_t j = first; j < next; ++j) {
      for (const Half &half : halves) see(half.given, j);
      for (int32_t c = child[j]; c >= 0; c = sibling[c]) see(lower, c);
    }
    std::sort(rows.begin(), rows.end());
    rows.insert(rows.begin(), next - first, 0);
    for (int32_t j = first; j < next; ++j) rows[j - first] = j;
    for (size_t k = 0; k < rows.size(); ++k) place[rows[k]] = static_cast<int32_t>(k);
  }

  void assemble(Half &half, int32_t first, int32_t next)
  {
    half.front.assign(rows.size() * rows.size(), 0.0);
    for (int32_t j = first; j < next; ++j) {
      const Columns &given = half.given;
      for (int64_t p = given.start[j]; p < given.start[j + 1]; ++p)
        if (given.row[p] >= j) column(half, j - first)[place[given.row[p]]] += given.value[p];
      for (int32_t c = child[j]; c >= 0; c = sibling[c]) add(half, c);
    }
  }

  void add(Half &half, int32_t from)
  {
    there.clear();
    for (int64_t p = lower.start[from]; p < lower.start[from + 1]; ++p) there.push_back(place[lower.row[p]]);
    const double *entry = half.update[from].data();
    for (size_t j = 0; j < there.size(); ++j) {
      double *to = column(half, there[j]);
      for (size_t i = j; i < there.size(); ++i) to[there[i]] += *entry++;
    }
    std::vector<double>().swap(half.update[from]);
  }

  void store(Half &half, int32_t first, int32_t next)
  {
    const int32_t size = static_cast<int32_t>(rows.size()), pivots = next - first;
    for (int32_t j = 0; j < pivots; ++j) {
      const int64_t start = lower.start[first + j] - (j + 1);
      for (int32_t k = j + 1; k < size; ++k) {
        row[start + k] = rows[k];
        half.made[start + k] = column(half, j)[k] / pivot[first + j];
      }
    }
    std::vector<double> &update = half.update[next - 1];
    update.reserve(static_cast<size_t>(size - pivots) * (size - pivots + 1) / 2);
    for (int32_t j = pivots; j < size; ++j) update.insert(update.end(), column(half, j) + j, column(half, j) + size);
  }
};

// As members: a template argument would lose the attributes.
struct Alone {
  typedef double Number;
};
struct Pair {
  typedef double Number __attribute__((vector_size(16), aligned(8), may_alias));
};
struct Four {
  typedef double Number __attribute__((vector_size(32), aligned(8), may_alias));
};

// C neighbouring columns of one pattern, and a number, or some numbers at once, of each row of x.
template <int C, class Kind> struct Run {
  typedef typename Kind::Number Number;
  const Columns &lower;
  const double *pivot;
  int64_t sides;
  double *x;

  INLINE Number &row(int64_t number) const { return *reinterpret_cast<Number *>(x + number * sides); }
  // The entry of L in one of the columns and in the row of a later one.
  INLINE double inside(int32_t j, int column, int later) const
  {
    return lower.value[lower.start[j + column] + later - column - 1];
  }
  // The entries of L in a column below those of the other columns.
  INLINE const double *below(int32_t j, int column) const
  {
    return lower.value + lower.start[j + column] + C - 1 - column;
  }

  INLINE void forward(int32_t j) const
  {
    Number now[C];
    const double *entry[C];
    for (int c = 0; c < C; ++c) {
      entry[c] = below(j, c);
      now[c] = row(j + c);
      for (int earlier = 0; earlier < c; ++earlier) now[c] -= inside(j, earlier, c) * now[earlier];
      row(j + c) = now[c];
    }
    const int32_t *place = lower.row + lower.start[j + C - 1], rows = lower.count(j + C - 1);
    for (int32_t p = 0; p < rows; ++p) {
      Number sum = entry[0][p] * now[0];
      for (int c = 1; c < C; ++c) sum += entry[c][p] * now[c];
      row(place[p]) -= sum;
    }
  }

  INLINE void backward(int32_t j) const
  {
    Number now[C];
    const double *entry[C];
    for (int c = 0; c < C; ++c) {
      entry[c] = below(j, c);
      now[c] = row(j + c) / pivot[j + c];
    }
    const int32_t *place = lower.row + lower.start[j + C - 1], rows = lower.count(j + C - 1);
    for (int32_t p = 0; p < rows; ++p) {
      const Number known = row(place[p]);
      for (int c = 0; c < C; ++c) now[c] -= entry[c][p] * known;
    }
    for (int c = C - 1; c >= 0; --c) {
      for (int later = c + 1; later < C; ++later) now[c] -= inside(j, c, later) * now[later];
      row(j + c) = now[c];
    }
  }
};

// Whether the three columns from j on, such as the coordinates of a disk, have one pattern.
INLINE bool triple(const Columns &lower, int32_t j)
{
  if (j < 0 || j + 3 > lower.size || lower.count(j) < 2) return false;
  return lower.row[lower.start[j]] == j + 1 && lower.row[lower.start[j] + 1] == j + 2 &&
         lower.count(j + 1) + 1 == lower.count(j) && lower.count(j + 2) + 2 == lower.count(j);
}

template <class Kind>
INLINE void solve(const Columns &lower, const Columns &upper, const double *pivot, int64_t sides, double *x)
{
  const Run<1, Kind> first = {lower, pivot, sides, x}, one = {upper, pivot, sides, x};
  const Run<3, Kind> first_three = {lower, pivot, sides, x}, three = {upper, pivot, sides, x};
  for (int32_t j = 0; j < lower.size;) {
    const bool all = triple(lower, j);
    all ? first_three.forward(j) : first.forward(j);
    j += all ? 3 : 1;
  }
  for (int32_t j = lower.size; j > 0;) {
    const bool all = triple(lower, j - 3);
    j -= all ? 3 : 1;
    all ? three.backward(j) : one.backward(j);
  }
}

// Some of the right sides at once, as long as there are as many.
EVERY_MACHINE void solve_all(const Columns &lower, const Columns &upper, const double *pivot, int32_t sides, double *x)
{
  int32_t done = 0;
  for (; done + 4 <= sides; done += 4) solve<Four>(lower, upper, pivot, sides, x + done);
  for (; done + 2 <= sides; done += 2) solve<Pair>(lower, upper, pivot, sides, x + done);
  for (; done < sides; ++done) solve<Alone>(lower, upper, pivot, sides, x + done);
}

}    // namespace

// The elimination tree of a matrix: the parent of each column, -1 for a root, and its entries of L below the diagonal.
EXPORTED void elimination_tree(int32_t size, const int64_t *start, const int32_t *row, int32_t *parent, int64_t *below)
{
  std::vector<int32_t> seen(size);
  for (int32_t k = 0; k < size; ++k) {
    parent[k] = -1;
    below[k] = 0;
    seen[k] = k;
    for (int64_t p = start[k]; p < start[k + 1]; ++p)
      for (int32_t i = row[p]; i < k && seen[i] != k; i = parent[i]) {
        if (parent[i] < 0) parent[i] = k;
        ++below[i];
        seen[i] = k;
      }
  }
}

// Fills L, D and U^T of a matrix A: 1 if it has, 0 if a pivot is zero, -1 without enough memory. Given are the columns
// of A and of A^T; without A^T, A is symmetric.
EXPORTED int32_t factor_ldu(int32_t size, const int64_t *start, const int32_t *row, const double *value,
                            const int64_t *turned_start, const int32_t *turned_row, const double *turned_value,
                            const int32_t *parent, const int64_t *lower_start, int32_t *lower_row, double *lower_value,
                            double *upper_value, double *pivot)
{
  const Columns lower = {size, lower_start, lower_row, lower_value};
  try {
    std::vector<Multifrontal::Half> halves = {{{size, start, row, value}, lower_value, {}, {}}};
    if (turned_start) halves.push_back({{size, turned_start, turned_row, turned_value}, upper_value, {}, {}});
    return Multifrontal(parent, lower, lower_row, halves, pivot).factor();
  } catch (const std::bad_alloc &) {
    return -1;
  }
}

// L D U x = b for several right sides: x, shape (n, sides) by rows, holds b before and x after.
EXPORTED void solve_ldu(int32_t size, const int64_t *start, const int32_t *row, const double *lower_value,
                        const double *upper_value, const double *pivot, int32_t sides, double *x)
{
  const Columns lower = {size, start, row, lower_value}, upper = {size, start, row, upper_value};
  solve_all(lower, upper, pivot, sides, x);
}
