#include "contact_kernel.h"

#include <algorithm>
#include <cstring>
#include <type_traits>

// Fused multiply-add makes exact products fast, and vectors of four or eight do the rest.
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__)
#define FAULTGOUGE_DISPATCH __attribute__((target_clones("avx512f", "fma", "default")))
#else
#define FAULTGOUGE_DISPATCH
#endif

namespace faultgouge {

namespace {

// so many contacts that their columns stay in the first-level cache
constexpr int BATCH = 64;

// aligned so that no vector straddles two cache lines
struct alignas(64) DoubleColumn {
  double value[BATCH];
  FAULTGOUGE_INLINE double load(int k) const { return value[k]; }
  FAULTGOUGE_INLINE void store(int k, double number) { value[k] = number; }
};

struct alignas(64) CompensatedColumn {
  double high[BATCH], low[BATCH];
  FAULTGOUGE_INLINE Compensated load(int k) const { return {high[k], low[k]}; }
  FAULTGOUGE_INLINE void store(int k, Compensated number)
  {
    high[k] = number.high;
    low[k] = number.low;
  }
};

template <class Number> struct Batch {
  using Column = std::conditional_t<std::is_same_v<Number, double>, DoubleColumn, CompensatedColumn>;

  int count = 0;
  int pair[BATCH];
  Column branch_x, branch_y, slip, overlap, normal, normal_x, normal_y, tangential, force_x, force_y;
  double radius_i[BATCH], radius_j[BATCH], moved_x[BATCH], moved_y[BATCH], rolled[BATCH];
};

// high parts of a contact cannot be farther apart than its reach and this
FAULTGOUGE_INLINE double margin(double, const FixedPointGrid &)
{
  return 0.0;
}
FAULTGOUGE_INLINE double margin(Compensated, const FixedPointGrid &grid)
{
  return 8.0 * grid.spacing;
}

// x, y and tangential force of a pair, and their signs for its first and its second disk
using Four = double __attribute__((vector_size(32)));
constexpr Four SIGN[2] = {{1.0, 1.0, 1.0, 1.0}, {-1.0, -1.0, 1.0, 1.0}};

FAULTGOUGE_INLINE void load(Four &four, const PairForce &numbers)
{
  static_assert(sizeof(Four) == sizeof(PairForce), "one vector");
  std::memcpy(&four, &numbers, sizeof(Four));
}

FAULTGOUGE_INLINE void add(PairForce &sum, const Four &more)
{
  Four total;
  load(total, sum);
  total += more;
  std::memcpy(&sum, &total, sizeof(Four));
}

FAULTGOUGE_INLINE void give_force(ContactPairs &pairs, int p, int, double x, double y, double tangential)
{
  pairs.force[p] = PairForce{x, y, tangential, 0.0};
}

FAULTGOUGE_INLINE void give_force(ContactPairs &pairs, int p, int owned, Compensated x, Compensated y,
                                  Compensated tangential)
{
  const int i = pairs.first[p], j = pairs.second[p];
  const Four high{x.high, y.high, tangential.high, 0.0}, low{x.low, y.low, tangential.low, 0.0};
  add(pairs.disk_force[i].high, high);
  add(pairs.disk_force[i].low, low);
  if (j >= owned) return;
  add(pairs.disk_force[j].high, SIGN[1] * high);
  add(pairs.disk_force[j].low, SIGN[1] * low);
}

template <class Number, bool FRICTION> FAULTGOUGE_INLINE void open(ContactPairs &pairs, int p)
{
  if constexpr (std::is_same_v<Number, double>) pairs.force[p] = PairForce{};
  if constexpr (FRICTION) pairs.touching[p] = 0;
}

template <class Number, bool FRICTION, bool ADVANCE>
FAULTGOUGE_INLINE void add(Batch<Number> &batch, const ContactPairs &pairs, int p, const Branch<Number> &r,
                           const Disks &disks, double dt)
{
  const int k = batch.count++, i = pairs.first[p], j = pairs.second[p];
  batch.pair[k] = p;
  batch.branch_x.store(k, r.x);
  batch.branch_y.store(k, r.y);
  batch.radius_i[k] = disks.radius[i];
  batch.radius_j[k] = disks.radius[j];
  if constexpr (!FRICTION) return;

  const bool known = pairs.touching[p];
  if constexpr (std::is_same_v<Number, double>)
    batch.slip.store(k, known ? pairs.slip[p] : 0.0);
  else
    batch.slip.store(k, known ? Compensated(pairs.slip[p], pairs.slip_low[p]) : Compensated());
  if constexpr (ADVANCE) {
    const double *const vi = disks.v + 3 * i, *const vj = disks.v + 3 * j;
    const double step = known ? dt : 0.0;    // a new contact begins without slip
    batch.moved_x[k] = (vi[0] - vj[0]) * step;
    batch.moved_y[k] = (vi[1] - vj[1]) * step;
    batch.rolled[k] = (disks.radius[i] * disks.omega[3 * i + 2] + disks.radius[j] * disks.omega[3 * j + 2]) * step;
  }
}

// overlaps, directions and normal forces
template <class Number> FAULTGOUGE_INLINE void normal_forces(Batch<Number> &batch, const MindlinLaw law)
{
  for (int k = 0; k < batch.count; k++) {
    const Branch<Number> r{batch.branch_x.load(k), batch.branch_y.load(k)};
    const Geometry<Number> contact = geometry(r, batch.radius_i[k], batch.radius_j[k]);
    const Number normal = law.normal_force(contact.overlap);
    batch.overlap.store(k, contact.overlap);
    batch.normal.store(k, normal);
    batch.normal_x.store(k, contact.direction(r.x));
    batch.normal_y.store(k, contact.direction(r.y));
  }
}

template <class Number> FAULTGOUGE_INLINE double slip_increment(const Batch<Number> &batch, int k)
{
  const Vector r{value(batch.branch_x.load(k)), value(batch.branch_y.load(k))};
  return midpoint_slip(r, {batch.moved_x[k], batch.moved_y[k]}) - batch.rolled[k];
}

// slips, advanced if wanted, and tangential forces
template <class Number, bool ADVANCE>
FAULTGOUGE_INLINE void tangential_forces(Batch<Number> &batch, const MindlinLaw law)
{
  const Number limit_ratio = law.slip_limit_ratio<Number>();
  // compensated operations wait for each other so long that increments are faster in a loop of their own
  constexpr bool APART = ADVANCE && std::is_same_v<Number, Compensated>;
  double increment[BATCH];
  if constexpr (APART)
    for (int k = 0; k < batch.count; k++) increment[k] = slip_increment(batch, k);
  for (int k = 0; k < batch.count; k++) {
    const Number limit = limit_ratio * batch.overlap.load(k);
    Number slip = batch.slip.load(k);
    if constexpr (ADVANCE) slip = advanced_slip(slip, APART ? increment[k] : slip_increment(batch, k), limit);
    batch.slip.store(k, slip);
    batch.tangential.store(k, law.tangential_force(batch.normal.load(k), slip, limit));
  }
}

// as they are added up
FAULTGOUGE_INLINE double summand(double force, const SummationGrid &)
{
  return force;
}
FAULTGOUGE_INLINE Compensated summand(Compensated force, const SummationGrid &grid)
{
  return grid.rounded(force);
}

template <class Number, bool FRICTION> FAULTGOUGE_INLINE void components(Batch<Number> &batch, const Grids grids)
{
  for (int k = 0; k < batch.count; k++) {
    const Number nx = batch.normal_x.load(k), ny = batch.normal_y.load(k), normal = batch.normal.load(k);
    Number x = normal * nx, y = normal * ny;
    if constexpr (FRICTION) {
      const Number tangential = batch.tangential.load(k);
      x = x - tangential * ny;
      y = y + tangential * nx;
      batch.tangential.store(k, summand(tangential, grids.tangential));
    }
    batch.force_x.store(k, summand(x, grids.force));
    batch.force_y.store(k, summand(y, grids.force));
  }
}

template <class Number, bool FRICTION, bool ADVANCE>
FAULTGOUGE_INLINE void evaluate(Batch<Number> &batch, const MindlinLaw law, const Grids &grids)
{
  normal_forces(batch, law);
  if constexpr (FRICTION) tangential_forces<Number, ADVANCE>(batch, law);
  components<Number, FRICTION>(batch, grids);
}

// puts the results where they belong; returns a pair with one centre inside of the other disk, or else what it is given
template <class Number, bool FRICTION>
FAULTGOUGE_INLINE int empty(Batch<Number> &batch, ContactPairs &pairs, int owned, int crushed)
{
  for (int k = 0; k < batch.count; k++) {
    const int p = batch.pair[k];
    if (!(leading(batch.overlap.load(k)) <= std::min(batch.radius_i[k], batch.radius_j[k]))) crushed = p;
    if (leading(batch.overlap.load(k)) <= 0.0) {
      open<Number, FRICTION>(pairs, p);
      continue;
    }
    const Number tangential = FRICTION ? batch.tangential.load(k) : Number(0.0);
    give_force(pairs, p, owned, batch.force_x.load(k), batch.force_y.load(k), tangential);
    if constexpr (FRICTION) {
      pairs.touching[p] = 1;
      pairs.slip[p] = leading(batch.slip.load(k));
      if constexpr (std::is_same_v<Number, Compensated>) pairs.slip_low[p] = batch.slip.low[k];
    }
  }
  batch.count = 0;
  return crushed;
}

template <class Number, bool FRICTION, bool ADVANCE>
FAULTGOUGE_INLINE int all_forces(ContactPairs &pairs, const Disks &disks, const Period &box, const MindlinLaw &law,
                                 double dt, const Grids &grids)
{
  Batch<Number> batch;
  int crushed = -1;
  for (int p = 0, n = pairs.size(); p < n; p++) {
    const Branch<double> high = leading_branch(pairs, p, disks, box);
    const double rsq = high.x * high.x + high.y * high.y;
    const double reach =
        disks.radius[pairs.first[p]] + disks.radius[pairs.second[p]] + margin(Number(), grids.coordinate);
    if (rsq >= reach * reach) {
      open<Number, FRICTION>(pairs, p);
      continue;
    }
    Branch<Number> r{high.x, high.y};
    if constexpr (std::is_same_v<Number, Compensated>) {
      const Branch<double> low = low_branch(pairs, p, disks, box);
      r.x.low = low.x;
      r.y.low = low.y;
    }
    add<Number, FRICTION, ADVANCE>(batch, pairs, p, r, disks, dt);
    if (batch.count < BATCH) continue;
    evaluate<Number, FRICTION, ADVANCE>(batch, law, grids);
    crushed = empty<Number, FRICTION>(batch, pairs, disks.owned, crushed);
  }
  evaluate<Number, FRICTION, ADVANCE>(batch, law, grids);
  return empty<Number, FRICTION>(batch, pairs, disks.owned, crushed);
}

template <class Number>
FAULTGOUGE_INLINE FloorContact<Number> on_floor(const MindlinLaw &law, Number overlap, Number slip, double increment,
                                                bool friction, bool advance)
{
  FloorContact<Number> contact{law.normal_force(overlap), 0.0, slip, 0.0};
  if (!friction) return contact;
  contact.slip_limit = law.slip_limit_ratio<Number>() * overlap;
  if (advance) contact.slip = advanced_slip(slip, increment, contact.slip_limit);
  contact.tangential = law.tangential_force(contact.normal, contact.slip, contact.slip_limit);
  return contact;
}

}    // namespace

FAULTGOUGE_DISPATCH
int contact_forces(ContactPairs &pairs, const Disks &disks, const Period &box, const MindlinLaw &law, double dt,
                   bool friction, bool advance)
{
  const Grids none{};
  if (!friction) return all_forces<double, false, false>(pairs, disks, box, law, dt, none);
  if (advance) return all_forces<double, true, true>(pairs, disks, box, law, dt, none);
  return all_forces<double, true, false>(pairs, disks, box, law, dt, none);
}

FAULTGOUGE_DISPATCH
int compensated_contact_forces(ContactPairs &pairs, const Disks &disks, const Period &box, const MindlinLaw &law,
                               double dt, bool friction, bool advance, const Grids &grids)
{
  if (!friction) return all_forces<Compensated, false, false>(pairs, disks, box, law, dt, grids);
  if (advance) return all_forces<Compensated, true, true>(pairs, disks, box, law, dt, grids);
  return all_forces<Compensated, true, false>(pairs, disks, box, law, dt, grids);
}

FAULTGOUGE_DISPATCH
void sum_forces(const ContactPairs &pairs, const Disks &disks, const Forces &forces)
{
  for (int i = 0; i < disks.owned; i++) {
    Four sum{}, more;
    for (int k = pairs.start[i]; k < pairs.start[i + 1]; k++) {
      load(more, pairs.force[pairs.row[k] >> 1]);
      sum += SIGN[pairs.row[k] & 1] * more;
    }
    forces.f[i][0] += sum[0];
    forces.f[i][1] += sum[1];
    forces.torque[i][2] -= disks.radius[i] * sum[2];
  }
}

FAULTGOUGE_DISPATCH
void take_compensated_forces(ContactPairs &pairs, const Disks &disks, const Forces &forces)
{
  for (int i = 0; i < disks.owned; i++) {
    auto &[high, low] = pairs.disk_force[i];
    const Compensated torque = -disks.radius[i] * Compensated(high.tangential, low.tangential);
    forces.f[i][0] += high.x;
    forces.f[i][1] += high.y;
    forces.torque[i][2] += torque.high;
    forces.low[i][forces.low_fx] = low.x;
    forces.low[i][forces.low_fy] = low.y;
    forces.low[i][forces.low_torque] = torque.low;
    pairs.disk_force[i] = CompensatedForce{};
  }
}

FAULTGOUGE_DISPATCH
FloorContact<double> floor_contact(const MindlinLaw &law, double overlap, double slip, double increment, bool friction,
                                   bool advance)
{
  return on_floor(law, overlap, slip, increment, friction, advance);
}

FAULTGOUGE_DISPATCH
FloorContact<Compensated> floor_contact(const MindlinLaw &law, Compensated overlap, Compensated slip, double increment,
                                        bool friction, bool advance)
{
  return on_floor(law, overlap, slip, increment, friction, advance);
}

}    // namespace faultgouge
