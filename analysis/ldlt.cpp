// Solutions of L D L^T x = b for several right sides at a time, see ldlt.py. L is lower triangular with ones on its
// diagonal, which is left out, in compressed columns; x, shape (n, sides) by rows, holds b before and x after.
//
// No fused multiply-add (-ffp-contract=off): results are then the same to the bit on every machine.

#include <cstdint>

namespace {

struct Factors {
  int32_t size;
  const int32_t *start, *row;
  const double *value, *pivot;
};

template <int K> inline __attribute__((always_inline)) void solve(const Factors &f, int64_t sides, double *x)
{
  double now[K];
  for (int32_t j = 0; j < f.size; ++j) {
    for (int k = 0; k < K; ++k) now[k] = x[sides * j + k];
    for (int32_t p = f.start[j]; p < f.start[j + 1]; ++p) {
      const double entry = f.value[p];
      double *below = x + sides * f.row[p];
      for (int k = 0; k < K; ++k) below[k] -= entry * now[k];
    }
  }
  for (int32_t j = f.size - 1; j >= 0; --j) {
    for (int k = 0; k < K; ++k) now[k] = x[sides * j + k] / f.pivot[j];
    for (int32_t p = f.start[j]; p < f.start[j + 1]; ++p) {
      const double entry = f.value[p];
      const double *below = x + sides * f.row[p];
      for (int k = 0; k < K; ++k) now[k] -= entry * below[k];
    }
    for (int k = 0; k < K; ++k) x[sides * j + k] = now[k];
  }
}

}    // namespace

#if defined(__x86_64__) && defined(__GLIBC__)    // where the loader chooses between versions
#define EVERY_MACHINE __attribute__((target_clones("avx2", "default")))
#else
#define EVERY_MACHINE
#endif

extern "C" {

EVERY_MACHINE __attribute__((visibility("default"))) void solve_ldlt(int32_t size, const int32_t *start,
                                                                     const int32_t *row, const double *value,
                                                                     const double *pivot, int32_t sides, double *x)
{
  const Factors factors = {size, start, row, value, pivot};
  int32_t done = 0;
  for (; done + 6 <= sides; done += 6) solve<6>(factors, sides, x + done);
  for (; done < sides; ++done) solve<1>(factors, sides, x + done);
}
}
