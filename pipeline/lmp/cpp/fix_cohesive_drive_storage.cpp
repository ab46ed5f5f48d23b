/* SPDX-License-Identifier: GPL-2.0-or-later
   What fix cohesive/drive keeps for each particle, and in restart files. */

#include "fix_cohesive_drive.h"

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "memory.h"

#include <cstring>

using namespace LAMMPS_NS;

// of what stands in restart files; another layout, another number. Before 2 there was none
static constexpr double FORMAT = 3.0;

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

// sums of single ranks stand there for all of them
void FixCohesiveDrive::write_restart(FILE *fp)
{
  State all = state;
  MPI_Reduce(&state.window.gauge, &all.window.gauge, 1, MPI_DOUBLE, MPI_SUM, 0, world);
  MPI_Reduce(&state.damping_now, &all.damping_now, 1, MPI_DOUBLE, MPI_SUM, 0, world);
  if (comm->me != 0) return;
  const int size = sizeof(double) + sizeof(State);
  fwrite(&size, sizeof(int), 1, fp);
  fwrite(&FORMAT, sizeof(double), 1, fp);
  fwrite(&all, sizeof(State), 1, fp);
}

void FixCohesiveDrive::restart(char *buf)
{
  double format;
  memcpy(&format, buf, sizeof(double));
  if (format != FORMAT)
    error->all(FLERR, "the restart file holds fix cohesive/drive in format {:g}, this version reads format {:g}: begin "
               "again, or go on with the version that wrote it", format, FORMAT);
  memcpy(&state, buf + sizeof(double), sizeof(State));
  if (comm->me != 0) state.window.gauge = state.damping_now = 0.0;
}
