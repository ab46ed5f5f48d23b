/* SPDX-License-Identifier: GPL-2.0-or-later */

#include "fix_cohesive_nve.h"

#include "bond_cohesive.h"

#include "atom.h"
#include "error.h"
#include "force.h"
#include "update.h"
#include "utils.h"

#include <cstring>

using namespace LAMMPS_NS;
using namespace FixConst;

// fix ID group cohesive/nve [radius R]: discs of mass m turn with m R²/2; without R with d_cohesive_inertia as it is
FixCohesiveNVE::FixCohesiveNVE(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg), bond(nullptr), radius(0.0)
{
  if (narg != 3 && (narg != 5 || strcmp(arg[3], "radius") != 0))
    error->all(FLERR, "fix cohesive/nve takes 'radius' and a length, or nothing");
  if (narg == 5) {
    radius = utils::numeric(FLERR, arg[4], false, lmp);
    if (!(radius > 0.0)) error->all(FLERR, "radius = {:g} must be positive", radius);
  }
  time_integrate = 1;
  scalar_flag = 1;    // kinetic energy of the rotations
  global_freq = 1;
  extscalar = 1;
}

int FixCohesiveNVE::setmask()
{
  return INITIAL_INTEGRATE | FINAL_INTEGRATE;
}

void FixCohesiveNVE::init()
{
  bond = dynamic_cast<BondCohesive *>(force->bond_match("cohesive"));
  if (!bond) error->all(FLERR, "fix cohesive/nve needs bond_style cohesive");
}

double FixCohesiveNVE::mass_of(int i) const
{
  return atom->rmass ? atom->rmass[i] : atom->mass[atom->type[i]];
}

void FixCohesiveNVE::setup(int)
{
  if (!bond->slides()) return;
  double *inertia = bond->rotation("inertia");
  for (int i = 0; i < atom->nlocal; i++) {
    if (!(atom->mask[i] & groupbit)) continue;
    if (radius > 0.0) inertia[i] = 0.5 * mass_of(i) * radius * radius;
    if (!(inertia[i] > 0.0))
      error->one(FLERR, "particle {} has no moment of inertia: give fix cohesive/nve a radius", atom->tag[i]);
  }
}

template <bool MOVE> void FixCohesiveNVE::advance()
{
  const double dt = update->dt, half = 0.5 * dt * force->ftm2v;
  double **x = atom->x, **v = atom->v, **f = atom->f;
  const bool turns = bond->slides();
  double *theta = turns ? bond->rotation("theta") : nullptr, *omega = turns ? bond->rotation("omega") : nullptr;
  const double *torque = turns ? bond->rotation("torque") : nullptr;
  const double *inertia = turns ? bond->rotation("inertia") : nullptr;
  for (int i = 0; i < atom->nlocal; i++) {
    if (!(atom->mask[i] & groupbit)) continue;
    const double push = half / mass_of(i);
    for (int k = 0; k < 2; k++) {
      v[i][k] += push * f[i][k];
      if (MOVE) x[i][k] += dt * v[i][k];
    }
    if (!turns) continue;
    omega[i] += half / inertia[i] * torque[i];
    if (MOVE) theta[i] += dt * omega[i];
  }
}

void FixCohesiveNVE::initial_integrate(int)
{
  advance<true>();
}

void FixCohesiveNVE::final_integrate()
{
  advance<false>();
}

double FixCohesiveNVE::compute_scalar()
{
  if (!bond->slides()) return 0.0;
  const double *omega = bond->rotation("omega"), *inertia = bond->rotation("inertia");
  double own = 0.0, all = 0.0;
  for (int i = 0; i < atom->nlocal; i++)
    if (atom->mask[i] & groupbit) own += 0.5 * force->mvv2e * inertia[i] * omega[i] * omega[i];
  MPI_Allreduce(&own, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
}
