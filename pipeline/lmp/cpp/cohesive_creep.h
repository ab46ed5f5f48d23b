/* SPDX-License-Identifier: GPL-2.0-or-later
   A bond that creeps until its strength is reached, and softens from there; no LAMMPS, no files.
   The same as relaxation.py and creeping_softening.py, where the equations stand. */

#ifndef COHESIVE_CREEP_H
#define COHESIVE_CREEP_H

#include "cohesive_law.h"

namespace cohesive {

struct CreepState {
  double reached, opening, used;
  double onset;    // opening at which softening began; 0: it has not
  double arm[MOST_ARMS];

  bool softened() const { return onset != 0.0; }
};

// (1 - exp(-x))/x
inline double ramp(double x)
{
  return x != 0.0 ? -std::expm1(-x) / x : 1.0;
}

// (1 - 2 ramp(x) + ramp(2x))/x = x/3 - x^2/4 + ..., by its series where the difference would lose digits
inline double growth(double x)
{
  if (x >= 0.5) return (1.0 - 2.0 * ramp(x) + ramp(2.0 * x)) / x;
  double series = 0.0, term = 1.0, power = 1.0;
  for (int n = 1; n < 19; n++) {
    term *= -x / (n + 1);
    power *= 2.0;
    series += term * (power - 2.0);
  }
  return x != 0.0 ? series / x : 0.0;
}

// what one step of physical time does to every bond of a type
struct CreepStep {
  double left = 0.0, tangent = 0.0;    // stiffness that never relaxes; slope of the force within the step
  double stiffness[MOST_ARMS], kept[MOST_ARMS], gain[MOST_ARMS];
  double own[MOST_ARMS], mixed[MOST_ARMS], grown[MOST_ARMS];    // of the energy that dashpots use up

  CreepStep(const Law &law, double duration)
  {
    double shares = 0.0;
    for (int a = 0; a < law.arms; a++) shares += law.share[a];
    left = shares < 1.0 - 1e-12 ? law.k_n * (1.0 - shares) : 0.0;
    tangent = left;
    for (int a = 0; a < law.arms; a++) {
      const double x = duration / law.time[a];
      stiffness[a] = law.k_n * law.share[a];
      kept[a] = std::exp(-x);
      gain[a] = stiffness[a] * ramp(x);
      tangent += gain[a];
      own[a] = x * ramp(2.0 * x) / stiffness[a];
      mixed[a] = 2.0 * (ramp(x) - ramp(2.0 * x));
      grown[a] = stiffness[a] * growth(x);
    }
  }
};

inline double creep_way(const Law &law, const CreepState &state)
{
  if (!law.damageable() || !state.softened()) return 0.0;
  if (!(law.delta_max > state.onset)) return law.softening.end();
  return std::fmax((state.reached - state.onset) / (law.delta_max - state.onset), 0.0);
}

inline double creep_envelope(const Law &law, const CreepState &state)
{
  return law.f_max * law.softening.left(creep_way(law, state));
}

// from where openings of a softened bond count: below 0 where it has become shorter by creeping under compression
inline double creep_origin(const Law &law, const CreepState &state)
{
  return law.damageable() && state.softened() ? std::fmin(state.onset - law.delta_peak(), 0.0) : 0.0;
}

// force of a bond whose state has been advanced to its opening
inline double creep_force(const Law &law, const CreepStep &step, const CreepState &state)
{
  const double delta = state.opening;
  if (!state.softened()) {
    double force = 0.0;
    for (int a = 0; a < law.arms; a++) force += state.arm[a];
    return step.left * delta + force;
  }
  const double origin = creep_origin(law, state), own = delta - origin, top = state.reached - origin;
  if (!(own > 0.0)) return law.k_n * own;
  const double envelope = creep_envelope(law, state);
  return law.elastic_unloading ? std::fmax(envelope - law.k_n * (top - own), 0.0) : own / top * envelope;
}

inline double creep_stored(const Law &law, const CreepStep &step, const CreepState &state)
{
  const double delta = state.opening;
  if (state.softened()) {
    const double force = creep_force(law, step, state);
    return 0.5 * force * (law.elastic_unloading ? force / law.k_n : delta - creep_origin(law, state));
  }
  double springs = 0.0;
  for (int a = 0; a < law.arms; a++) springs += state.arm[a] * state.arm[a] / (2.0 * step.stiffness[a]);
  return 0.5 * step.left * delta * delta + springs;
}

// area of the branch up to the largest opening, less what is stored there
inline double creep_softening_work(const Law &law, const CreepState &state)
{
  if (!law.damageable() || !state.softened()) return 0.0;
  const double area = law.f_max * std::fmax(law.delta_max - state.onset, 0.0) * law.softening.area(creep_way(law, state));
  const double envelope = creep_envelope(law, state);
  return area - 0.5 * envelope * (law.elastic_unloading ? envelope / law.k_n : state.reached - creep_origin(law, state));
}

inline void creep_on(const Law &law, const CreepStep &step, CreepState &state, double opening)
{
  const double change = opening - state.opening;
  for (int a = 0; a < law.arms; a++) {
    const double force = state.arm[a];
    state.used += step.own[a] * force * force + step.mixed[a] * force * change + step.grown[a] * change * change;
    state.arm[a] = step.kept[a] * force + step.gain[a] * change;
  }
  state.opening = opening;
}

inline void begin_to_soften(const Law &law, const CreepStep &step, CreepState &state, double onset, double opening)
{
  const double before = creep_force(law, step, state);
  state.used += creep_stored(law, step, state) + 0.5 * (before + law.f_max) * (onset - state.opening);
  for (int a = 0; a < law.arms; a++) state.arm[a] = 0.0;
  state.onset = onset != 0.0 ? onset : 1e-300;
  state.reached = opening;
  state.opening = opening;
  state.used += creep_softening_work(law, state);
}

inline void advance(const Law &law, const CreepStep &step, CreepState &state, double opening)
{
  if (state.softened()) {
    if (opening > state.reached) {
      const double before = creep_softening_work(law, state);
      state.reached = opening;
      state.used += creep_softening_work(law, state) - before;
    }
    state.opening = opening;
    return;
  }
  double kept = step.left * state.opening;
  for (int a = 0; a < law.arms; a++) kept += step.kept[a] * state.arm[a];
  const double onset = state.opening + (law.f_max - kept) / step.tangent;
  if (opening >= onset)
    begin_to_soften(law, step, state, onset, opening);
  else
    creep_on(law, step, state, opening);
}

// the largest opening at which a bond that never crept would be as far along its branch; 0 before
inline double reached(const Law &law, const CreepState &state)
{
  if (!law.damageable() || !state.softened()) return 0.0;
  const double way = creep_way(law, state);
  return way >= law.softening.end() ? law.delta_end() : law.delta_peak() + way * (law.delta_max - law.delta_peak());
}

}    // namespace cohesive

#endif
