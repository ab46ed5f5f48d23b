/* SPDX-License-Identifier: GPL-2.0-or-later
   What fix cohesive/drive notes every few steps, and how fast it goes from there; the steps: fix_cohesive_drive.cpp */

#include "fix_cohesive_drive.h"

#include "bond_cohesive.h"

#include "atom.h"
#include "update.h"

#include <algorithm>
#include <cmath>

using namespace LAMMPS_NS;

// how much faster the rate falls than it rises
static constexpr double HASTE = 10.0;
// error of the load over the root mean square of the excess: the most of ten specimens, against equilibria
static constexpr double ERROR_PER_EXCESS = 2.25;
// a crack jumps where the mouth opens by so much more than the machine's way has opened it so far
static constexpr double JUMP = 3.0;

double FixCohesiveDrive::kinetic_energy() const
{
  double sum = 0.0;
  for (int i = 0; i < atom->nlocal; i++)
    sum += 0.5 * atom->rmass[i] * (atom->v[i][0] * atom->v[i][0] + atom->v[i][1] * atom->v[i][1]);
  if (bond->slides())
    for (int i = 0; i < atom->nlocal; i++) sum += 0.5 * inertia[i] * omega_z[i] * omega_z[i];
  return sum;
}

void FixCohesiveDrive::end_of_step()
{
  record();
  measure_lag();
  mark_frames();
  choose_rate();
}

// means over the steps since the last record, and the energies now
void FixCohesiveDrive::record()
{
  double stored, dissipated;
  bond->energies(stored, dissipated);
  const double local[5] = {state.window.gauge, kinetic_energy(), state.damping_now, stored, dissipated};
  double all[5];
  MPI_Allreduce(local, all, 5, MPI_DOUBLE, MPI_SUM, world);
  const double n = std::max(state.window.steps, 1.0);
  state.cmod = all[0] / n - state.cmod_zero;
  state.kinetic = all[1];
  state.damping += all[2];
  state.stored = all[3];
  state.dissipated = all[4];
  state.load_drive = state.window.drive / n;
  state.load_react = state.window.react / n;
  state.load = 0.5 * (state.load_drive + state.load_react);
  state.load_line_mean = state.window.load_line / n;
  state.peak = std::max(state.peak, state.load);
  state.window = {};
  state.damping_now = 0.0;
}

// What goes into motion and drag instead of the specimen, over the machine's way, is a force that the load is off by.
// The lag is that force over the peak load. For the error at a CMOD the way counts as no shorter than so much opening
// took so far, for where the crack jumps the machine stands still, and counts there only; where the mouth swings back
// nothing is added.
void FixCohesiveDrive::measure_lag()
{
  const double lost = state.kinetic + state.damping, now = std::fabs(lost - state.lost_before);
  const double way = state.rate * nevery * update->dt;
  const double opened = std::max(state.cmod - state.opened, 0.0);
  state.lost_before = lost;
  // rises at once, fades over a period
  const double keep = 1.0 - std::min(1.0, nevery * update->dt * omega / (2.0 * M_PI));
  state.lag = std::max(now / (state.peak * way), state.lag * keep);
  state.excess *= keep;
  double counted = state.excess;
  if (opened > 0.0 && state.cmod > 0.0) {
    const double usual = opened * state.load_line_mean / state.cmod;
    counted = now / std::max(way, usual);
    if (usual <= JUMP * way) counted = state.excess = std::max(counted, state.excess);
  }
  state.error_sum += counted * counted * opened;
  state.load_sum += state.load * state.load * opened;
  state.opened += opened;
}

// What the lag should be now: the share asked for is of the root mean square of the load over CMOD (of a load that rises
// in proportion before there is one). Where more of it was spent already less is left, down to a half.
double FixCohesiveDrive::lag_allowed() const
{
  if (!(state.load_sum > 0.0)) return lag_wanted / std::sqrt(3.0);
  const double mean = std::sqrt(state.load_sum / state.opened) / state.peak;
  const double spent = std::sqrt(state.error_sum / state.load_sum) / lag_wanted;
  return lag_wanted * std::min(mean, 1.0) / std::clamp(spent, 1.0, 2.0);
}

void FixCohesiveDrive::mark_frames()
{
  state.frame_due = 1.0;
  if (state.cmod < state.next_frame) return;
  state.frame_due = 0.0;
  const auto next = std::upper_bound(stations.begin(), stations.end(), state.cmod);
  state.next_frame = next == stations.end() ? INFINITY : *next;
}

// Drag and inertia act on the load with the square of the rate: so the rate follows the square root of
// wanted over measured lag, down ten times as fast as up. Velocities and their running means are scaled
// with it, which keeps the specimen on its path; the energy that this takes out counts as damping.
void FixCohesiveDrive::choose_rate()
{
  const double share = nevery * update->dt * omega / (2.0 * M_PI);
  const double wanted = lag_allowed();
  const double wish = std::sqrt(wanted / std::max(state.lag, 1e-3 * wanted));
  double factor = std::clamp(std::pow(wish, share * (wish < 1.0 ? HASTE : 1.0)), 0.5, 1.0 + share);
  factor = std::clamp(factor, lowest_rate / state.rate, highest_rate / state.rate);
  if (factor == 1.0) return;
  for (int i = 0; i < atom->nlocal; i++)
    for (int k = 0; k < 2; k++) {
      atom->v[i][k] *= factor;
      mean_v[i][k] *= factor;
    }
  if (bond->slides())
    for (int i = 0; i < atom->nlocal; i++) {
      omega_z[i] *= factor;
      mean_v[i][2] *= factor;
    }
  const double before = state.kinetic;
  state.kinetic *= factor * factor;
  state.damping += before - state.kinetic;
  state.rate *= factor;
}

double FixCohesiveDrive::compute_vector(int k)
{
  switch (k) {
    case 0: return state.cmod;
    case 1: return state.load;
    case 2: return state.load_line_mean;
    case 3: return state.load_drive;
    case 4: return state.load_react;
    case 5: return state.work;
    case 6: return state.stored;
    case 7: return state.dissipated;
    case 8: return state.kinetic;
    case 9: return state.damping;
    case 10: return state.rate;
    case 11: return state.load_sum > 0.0 ? ERROR_PER_EXCESS * std::sqrt(state.error_sum / state.load_sum) : 0.0;
    case 12: return state.frame_due;
    case 13: return state.cmod >= cmod_max ? 1.0 : 0.0;
    case 15: return state.time;
    default: return state.lag;
  }
}
