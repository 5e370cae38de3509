#include "contact_pairs.h"

#include "lammps.h"
#include "neigh_list.h"

#include <algorithm>

using namespace LAMMPS_NS;

namespace faultgouge {

void ContactPairs::build(const NeighList &list, const tagint *tag, int nlocal, bool with_slips)
{
  first.clear();
  second.clear();
  start.assign(nlocal + 1, 0);
  for (int ii = 0; ii < list.inum; ii++) {
    const int i = list.ilist[ii];
    for (int jj = 0; jj < list.numneigh[i]; jj++) {
      const int j = list.firstneigh[i][jj] & NEIGHMASK;
      first.push_back(i);
      second.push_back(j);
      start[i + 1]++;
      if (j < nlocal) start[j + 1]++;
    }
  }
  for (int i = 0; i < nlocal; i++) start[i + 1] += start[i];

  row.resize(start[nlocal]);
  first_tag.resize(size());
  second_tag.resize(size());
  std::vector<int> next(start.begin(), start.end() - 1);
  for (int p = 0; p < size(); p++) {
    first_tag[p] = tag[first[p]];
    second_tag[p] = tag[second[p]];
    row[next[first[p]]++] = 2 * p;
    if (second[p] < nlocal) row[next[second[p]]++] = 2 * p + 1;
  }

  const auto partner = [this](int entry) { return entry & 1 ? first_tag[entry >> 1] : second_tag[entry >> 1]; };
  for (int i = 0; i < nlocal; i++)
    std::sort(row.begin() + start[i], row.begin() + start[i + 1],
              [&](int a, int b) { return partner(a) < partner(b); });

  force.assign(size(), PairForce{0.0, 0.0, 0.0});
  if (!with_slips) return;
  slip.assign(size(), 0.0);
  touching.assign(size(), 0);
}

}    // namespace faultgouge
