// compute ID group signal FILE [scale S] [stretch T]
//
// Global scalar: S times the value that a table of (time, value) has at time step*dt/T, on straight lines between its
// rows and 0 before and after them. It depends on the step alone, so that runs on any number of ranks, restarted runs
// and runs in several pieces see the same numbers.

#ifndef LMP_COMPUTE_SIGNAL_H
#define LMP_COMPUTE_SIGNAL_H

#include "compute.h"

#include <string>
#include <vector>

namespace LAMMPS_NS {

class ComputeSignal : public Compute {
public:
  ComputeSignal(class LAMMPS *, int, char **);
  void init() override;
  double compute_scalar() override;
  double memory_usage() override;

private:
  std::string file;
  std::vector<double> times, values;
  double scale = 1.0, stretch = 1.0;

  void read();
  std::string fault();
};

}    // namespace LAMMPS_NS

#endif
