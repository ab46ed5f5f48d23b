/* SPDX-License-Identifier: GPL-2.0-or-later
   What fix cohesive/drive keeps for each particle, and in restart files. */

#include "fix_cohesive_drive.h"

#include "atom.h"
#include "comm.h"
#include "memory.h"

#include <cstring>

using namespace LAMMPS_NS;

double FixCohesiveDrive::memory_usage()
{
  return NMEAN * atom->nmax * sizeof(double);
}

void FixCohesiveDrive::grow_arrays(int nmax)
{
  memory->grow(mean_v, nmax, NMEAN, "cohesive/drive:mean_v");
}

void FixCohesiveDrive::copy_arrays(int i, int j, int)
{
  for (int k = 0; k < NMEAN; k++) mean_v[j][k] = mean_v[i][k];
}

// a particle that is created later
void FixCohesiveDrive::set_arrays(int i)
{
  for (int k = 0; k < 2; k++) mean_v[i][k] = atom->v[i][k];
  mean_v[i][2] = 0.0;
}

int FixCohesiveDrive::pack_exchange(int i, double *buf)
{
  for (int k = 0; k < NMEAN; k++) buf[k] = mean_v[i][k];
  return NMEAN;
}

int FixCohesiveDrive::unpack_exchange(int nlocal, double *buf)
{
  for (int k = 0; k < NMEAN; k++) mean_v[nlocal][k] = buf[k];
  return NMEAN;
}

int FixCohesiveDrive::pack_restart(int i, double *buf)
{
  buf[0] = NMEAN + 1;
  return 1 + pack_exchange(i, buf + 1);
}

void FixCohesiveDrive::unpack_restart(int nlocal, int nth)
{
  double **extra = atom->extra;
  int m = 0;
  for (int i = 0; i < nth; i++) m += static_cast<int>(extra[nlocal][m]);
  for (int k = 0; k < NMEAN; k++) mean_v[nlocal][k] = extra[nlocal][m + 1 + k];
}

int FixCohesiveDrive::size_restart(int)
{
  return NMEAN + 1;
}

int FixCohesiveDrive::maxsize_restart()
{
  return NMEAN + 1;
}

void FixCohesiveDrive::write_restart(FILE *fp)
{
  if (comm->me != 0) return;
  const int size = sizeof(State);
  fwrite(&size, sizeof(int), 1, fp);
  fwrite(&state, sizeof(State), 1, fp);
}

void FixCohesiveDrive::restart(char *buf)
{
  memcpy(&state, buf, sizeof(State));
}
