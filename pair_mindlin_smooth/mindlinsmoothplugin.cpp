// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// Registers the styles with LAMMPS, after a look at whether this LAMMPS is the one that the plugin was compiled for.
// The wheel does not ship lammpsplugin.h, so that its interface, which is stable C, is declared here.

#include "compute_layer_velocity.h"
#include "fix_addforce_signal.h"
#include "fix_dashpot_velocities.h"
#include "fix_disc_integrators.h"
#include "fix_drive_spring.h"
#include "fix_keep_histories.h"
#include "fix_low_parts.h"
#include "fix_slip_history.h"
#include "fix_wall_mindlin_smooth.h"
#include "fix_weaken_friction.h"
#include "pair_mindlin_smooth.h"

#include <cstdio>
#include <mpi.h>
#include <new>
#include <string>

using namespace LAMMPS_NS;

extern "C" {
struct lammpsplugin_t {
  const char *version, *style, *name, *info, *author;
  union {
    void *(*without_arguments)(void *);
    void *(*with_arguments)(void *, int, char **);
  } creator;
  void *handle;
};
typedef void (*lammpsplugin_regfunc)(lammpsplugin_t *, void *);

int lammps_version(void *handle);
int lammps_extract_setting(void *handle, const char *keyword);
}

static_assert(sizeof(lammpsplugin_t) == 56, "the layout that LAMMPS expects");

namespace {

template <class STYLE> void *create_pair(void *lmp)
{
  return static_cast<Pair *>(new STYLE(static_cast<LAMMPS *>(lmp)));
}

template <class STYLE> void *create_compute(void *lmp, int narg, char **arg)
{
  return static_cast<Compute *>(new STYLE(static_cast<LAMMPS *>(lmp), narg, arg));
}

template <class STYLE> void *create_fix(void *lmp, int narg, char **arg)
{
  return static_cast<Fix *>(new STYLE(static_cast<LAMMPS *>(lmp), narg, arg));
}

// What the library's version string says of an MPI that has this header.
#if defined(MPICH_VERSION)
constexpr const char *MPI_FAMILY = "MPICH";
#elif defined(OPEN_MPI)
constexpr const char *MPI_FAMILY = "Open MPI";
#elif defined(MPI_STUBS)
constexpr const char *MPI_FAMILY = "STUBS";
#else
constexpr const char *MPI_FAMILY = "";
#endif

// What builds the plugin for the LAMMPS of the environment, or of the headers that are named.
constexpr const char *REMEDY =
    "pip install --no-build-isolation --force-reinstall --no-deps faultgouge (for a LAMMPS of "
    "your own: cmake -S . -B build -DLAMMPS_HEADERS=DIR && cmake --build build)";

// The reason why this LAMMPS cannot use the plugin; empty if it can.
std::string mismatch(void *lmp)
{
  const auto says = [](const std::string &ours, const std::string &theirs) {
    return "was compiled for " + ours + " and does not work with " + theirs;
  };
  const int version = lammps_version(lmp);
  if (version != FAULTGOUGE_LAMMPS_VERSION)
    return says("LAMMPS " + std::to_string(FAULTGOUGE_LAMMPS_VERSION), "LAMMPS " + std::to_string(version));
  const int bits = 8 * lammps_extract_setting(lmp, "tagint");
  if (bits != 8 * int(sizeof(tagint)))
    return says("atom IDs of " + std::to_string(8 * sizeof(tagint)) + " bits",
                "this LAMMPS, whose IDs have " + std::to_string(bits) + " (-DLAMMPS_SIZES=smallbig or bigbig)");
  char library[MPI_MAX_LIBRARY_VERSION_STRING] = {};
  int length = 0;
  MPI_Get_library_version(library, &length);
  if (std::string(library).find(MPI_FAMILY) == std::string::npos)
    return says(std::string("the MPI of ") + MPI_FAMILY,
                "this LAMMPS, whose MPI is " +
                    std::string(library).substr(0, std::string(library).find_first_of(",\n")) + " (-DMPI_HEADERS)");
  return "";
}

void add_styles(void *lmp, void *handle, lammpsplugin_regfunc add)
{
  lammpsplugin_t plugin{};
  plugin.version = static_cast<LAMMPS *>(lmp)->version;
  plugin.author = "faultgouge";
  plugin.handle = handle;

  plugin.style = "pair";
  plugin.name = "mindlin/smooth";
  plugin.info = "Hertz or harmonic normal force, smoothed Mindlin tangential force with slip history, dashpots";
  plugin.creator.without_arguments = &create_pair<PairMindlinSmooth>;
  add(&plugin, lmp);

  plugin.style = "compute";
  plugin.name = "layer/velocity";
  plugin.info = "mean velocity of a layer, the same on any number of ranks";
  plugin.creator.with_arguments = &create_compute<ComputeLayerVelocity>;
  add(&plugin, lmp);

  plugin.style = "fix";
  const auto add_fix = [&](const char *name, const char *info, void *(*creator)(void *, int, char **)) {
    plugin.name = name;
    plugin.info = info;
    plugin.creator.with_arguments = creator;
    add(&plugin, lmp);
  };
  add_fix("slip/history", "slips of the contacts of pair mindlin/smooth", &create_fix<FixSlipHistory>);
  add_fix("wall/mindlin/smooth", "flat floor with the law of pair mindlin/smooth", &create_fix<FixWallMindlinSmooth>);
  add_fix("nve/disc", "velocity Verlet of disks in the plane", &create_fix<FixNVEDisc>);
  add_fix("low/parts", "low parts of coordinates and forces", &create_fix<FixLowParts>);
  add_fix("dashpot/velocities", "velocities that the dashpots of pair mindlin/smooth feel",
          &create_fix<FixDashpotVelocities>);
  add_fix("displace/disc", "moves disks by their velocities alone", &create_fix<FixDisplaceDisc>);
  add_fix("addforce/signal", "force of a signal of time on disks", &create_fix<FixAddForceSignal>);
  add_fix("drive/spring", "spring that draws a layer, the same on any number of ranks", &create_fix<FixDriveSpring>);
  add_fix("weaken/friction", "friction that weakens with the velocity of a layer", &create_fix<FixWeakenFriction>);
  add_fix("keep/histories", "copy of what fixes keep for each atom", &create_fix<FixKeepHistories>);
  add_fix("overdamped/disc", "overdamped relaxation of disks in the plane", &create_fix<FixOverdampedDisc>);
}

}    // namespace

// What vectors call for a size beyond all bounds. The library has it since 2021 alone (GLIBCXX_3.4.29), and the linker
// leads here instead (CMakeLists.txt), so that the plugin loads on older systems too.
extern "C" [[noreturn]] void __wrap__ZSt28__throw_bad_array_new_lengthv();
extern "C" [[noreturn]] void __wrap__ZSt28__throw_bad_array_new_lengthv()
{
  throw std::bad_alloc();
}

extern "C" __attribute__((visibility("default"))) void lammpsplugin_init(void *lmp, void *handle, void *regfunc)
{
  const std::string reason = mismatch(lmp);
  if (!reason.empty()) {
    if (lammps_extract_setting(lmp, "world_rank") == 0)
      fprintf(stderr, "ERROR: the faultgouge plugin %s: its styles are not available; build it for this LAMMPS: %s\n",
              reason.c_str(), REMEDY);
    return;
  }
  add_styles(lmp, handle, reinterpret_cast<lammpsplugin_regfunc>(regfunc));
}
