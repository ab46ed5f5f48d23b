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
// the load is off by up to about twice the lag (measured against the equilibrium engine)
static constexpr double ERROR_PER_LAG = 2.0;

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

// share of the machine's power, at peak load, that goes into motion and drag instead of the specimen
void FixCohesiveDrive::measure_lag()
{
  const double lost = state.kinetic + state.damping;
  const double power = state.peak * state.rate * nevery * update->dt;
  const double now = power > 0.0 ? (lost - state.lost_before) / power : 0.0;
  state.lost_before = lost;
  // rises at once, fades over a period
  const double share = std::min(1.0, nevery * update->dt * omega / (2.0 * M_PI));
  state.lag = std::max(std::fabs(now), state.lag * (1.0 - share));
  state.error_sum += state.lag * state.lag * (state.cmod - state.last_cmod);
  state.error_weight += state.cmod - state.last_cmod;
  state.last_cmod = state.cmod;
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
  const double wish = std::sqrt(lag_wanted / std::max(state.lag, 1e-3 * lag_wanted));
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
    case 11: return state.error_weight > 0.0 ? ERROR_PER_LAG * std::sqrt(state.error_sum / state.error_weight) : 0.0;
    case 12: return state.frame_due;
    case 13: return state.cmod >= cmod_max ? 1.0 : 0.0;
    case 15: return state.time;
    default: return state.lag;
  }
}
