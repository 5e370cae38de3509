#include "compute_layer_velocity.h"

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "update.h"

#include <algorithm>
#include <utility>
#include <vector>

using namespace LAMMPS_NS;

ComputeLayerVelocity::ComputeLayerVelocity(LAMMPS *lmp, int narg, char **arg) : Compute(lmp, narg, arg)
{
  if (narg != 3) error->all(FLERR, "compute layer/velocity takes no arguments, but got {}", narg - 3);
  scalar_flag = 1;
  extscalar = 0;
}

double ComputeLayerVelocity::compute_scalar()
{
  invoked_scalar = update->ntimestep;
  std::vector<std::pair<double, double>> mine;    // ID, velocity
  for (int i = 0; i < atom->nlocal; i++)
    if (atom->mask[i] & groupbit) mine.emplace_back(static_cast<double>(atom->tag[i]), atom->v[i][0]);

  std::vector<int> counts(comm->nprocs), offsets(comm->nprocs, 0);
  const int count = 2 * static_cast<int>(mine.size());
  MPI_Allgather(&count, 1, MPI_INT, counts.data(), 1, MPI_INT, world);
  for (int rank = 1; rank < comm->nprocs; rank++) offsets[rank] = offsets[rank - 1] + counts[rank - 1];
  std::vector<std::pair<double, double>> all((offsets.back() + counts.back()) / 2);
  MPI_Allgatherv(mine.data(), count, MPI_DOUBLE, all.data(), counts.data(), offsets.data(), MPI_DOUBLE, world);

  std::sort(all.begin(), all.end());
  double sum = 0.0;
  for (const auto &disk : all) sum += disk.second;
  scalar = all.empty() ? 0.0 : sum / static_cast<double>(all.size());
  return scalar;
}
