#include "compute_signal.h"

#include "comm.h"
#include "error.h"
#include "update.h"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

using namespace LAMMPS_NS;

ComputeSignal::ComputeSignal(LAMMPS *lmp, int narg, char **arg) : Compute(lmp, narg, arg)
{
  if (narg < 4) error->all(FLERR, "compute signal needs the name of a file with two columns, time and value");
  scalar_flag = 1;
  extscalar = 0;
  file = arg[3];
  for (int iarg = 4; iarg < narg; iarg += 2) {
    const std::string keyword = arg[iarg];
    if (keyword != "scale" && keyword != "stretch")
      error->all(FLERR, "compute signal knows scale and stretch, not {}", keyword);
    if (iarg + 1 == narg) error->all(FLERR, "compute signal: {} needs a number", keyword);
    const double number = utils::numeric(FLERR, arg[iarg + 1], false, lmp);
    (keyword == "scale" ? scale : stretch) = number;
  }
  if (!(stretch > 0.0)) error->all(FLERR, "compute signal: stretch = {} must be above 0", stretch);
  read();
}

// On rank 0 alone, which tells the others.
void ComputeSignal::read()
{
  std::string says = comm->me == 0 ? fault() : "";
  int size[2] = {static_cast<int>(says.size()), static_cast<int>(times.size())};
  MPI_Bcast(size, 2, MPI_INT, 0, world);
  says.resize(size[0]);
  MPI_Bcast(&says[0], size[0], MPI_CHAR, 0, world);
  if (!says.empty()) error->all(FLERR, "compute signal: {} {}", file, says);
  times.resize(size[1]);
  values.resize(size[1]);
  MPI_Bcast(times.data(), size[1], MPI_DOUBLE, 0, world);
  MPI_Bcast(values.data(), size[1], MPI_DOUBLE, 0, world);
}

// Reads the table; what is wrong with it, or nothing.
std::string ComputeSignal::fault()
{
  std::ifstream stream(file);
  if (!stream) return "cannot be read: correct its name";
  std::string line;
  for (int number = 1; std::getline(stream, line); number++) {
    line = line.substr(0, line.find('#'));
    if (line.find_first_not_of(" \t\r,") == std::string::npos) continue;
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream columns(line);
    std::string first, second, more;
    columns >> first >> second;
    if (second.empty() || columns >> more || !utils::is_double(first) || !utils::is_double(second))
      return "has something else than two numbers, time and value, in line " + std::to_string(number);
    const double time = std::strtod(first.c_str(), nullptr), value = std::strtod(second.c_str(), nullptr);
    if (!std::isfinite(time) || !std::isfinite(value))
      return "has a number that is not finite in line " + std::to_string(number);
    if (!times.empty() && time <= times.back())
      return "has a time that is not later than the one before in line " + std::to_string(number) + ": sort it";
    times.push_back(time);
    values.push_back(value);
  }
  return times.size() < 2 ? "has fewer than two rows: a signal needs a beginning and an end" : "";
}

void ComputeSignal::init()
{
  double shortest = times[1] - times[0];
  for (size_t k = 2; k < times.size(); k++) shortest = std::min(shortest, times[k] - times[k - 1]);
  if (comm->me == 0 && update->dt > shortest * stretch)
    error->warning(FLERR, "compute signal: rows of {} are closer than the time step, some are never seen", file);
}

double ComputeSignal::compute_scalar()
{
  invoked_scalar = update->ntimestep;
  const double time = static_cast<double>(update->ntimestep) * update->dt / stretch;
  scalar = 0.0;
  if (time < times.front() || time > times.back()) return scalar;
  const auto after =
      std::min<size_t>(std::upper_bound(times.begin(), times.end(), time) - times.begin(), times.size() - 1);
  const double share = (time - times[after - 1]) / (times[after] - times[after - 1]);
  scalar = scale * (values[after - 1] + share * (values[after] - values[after - 1]));
  return scalar;
}

double ComputeSignal::memory_usage()
{
  return 2.0 * times.size() * sizeof(double);
}
