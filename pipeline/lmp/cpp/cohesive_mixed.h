/* SPDX-License-Identifier: GPL-2.0-or-later
   Opening and sliding together: damage in mixed mode after Camanho and Davila (2002), friction on what has failed.
   No LAMMPS, no files. The same as mixed_softening.py, where the equations stand. */

#ifndef COHESIVE_MIXED_H
#define COHESIVE_MIXED_H

#include "cohesive_law.h"

namespace cohesive {

// D with secant unloading, the way s with elastic; plastic opening and sliding, once failed the stretch of the spring
// of friction and the place from which it counts; energy used up
struct MixedState {
  double progress, opening, sliding, used;
};

struct Mode {
  double size, a, b, onset, end, onset_force;

  Mode(const Law &law, double opening, double sliding)
  {
    const double pulled = std::fmax(opening, 0.0);
    size = std::hypot(pulled, sliding);
    a = size > 0.0 ? pulled / size : 1.0;
    b = size > 0.0 ? sliding / size : 0.0;
    onset = 1.0 / std::hypot(law.k_n * a / law.f_max, law.k_s * b / law.f_shear);
    end = 1.0 / (onset * (law.k_n * a * a / (law.f_max * law.delta_max) +
                          law.k_s * b * b / (law.f_shear * law.delta_shear)));
    onset_force = (law.k_n * a * a + law.k_s * b * b) * onset;
  }
};

inline double last_progress(const Law &law)
{
  return law.elastic_unloading ? law.softening.end() : 1.0;
}

inline bool has_failed(const Law &law, const MixedState &state)
{
  return state.progress >= last_progress(law);
}

// energy used up along the branch over the force at its onset: area less half of g delta_e
inline double secant_work(const Law &law, double way, double onset, double end)
{
  way = std::fmin(way, law.softening.end());
  const double size = onset + way * (end - onset);
  return onset / 2.0 + (end - onset) * law.softening.area(way) - 0.5 * law.softening.left(way) * size;
}

inline void damage_by(const Law &law, MixedState &state, const Mode &mode)
{
  if (!(mode.size > mode.onset)) return;
  const double way = (mode.size - mode.onset) / (mode.end - mode.onset);
  const double damage = 1.0 - law.softening.left(way) * mode.onset / mode.size;
  if (!(damage > state.progress)) return;
  const double before = law.softening.way_of_damage(state.progress, mode.end / mode.onset);
  state.used += mode.onset_force *
      (secant_work(law, way, mode.onset, mode.end) - secant_work(law, before, mode.onset, mode.end));
  state.progress = damage;
}

inline void yield_by(const Law &law, MixedState &state, const Mode &mode)
{
  const double left = law.softening.left(state.progress), last = last_progress(law);
  if (!(mode.size > left * mode.onset) || state.progress >= last) return;
  const double way = (mode.size - left * mode.onset) / (mode.end - mode.onset);
  const double after = std::fmin(state.progress + way, last), left_after = law.softening.left(after);
  const double slip = mode.size - left_after * mode.onset;
  double work = 0.5 * mode.onset * (left * left - left_after * left_after);
  work += (mode.end - mode.onset) * (law.softening.area(after) - law.softening.area(state.progress));
  state.used += mode.onset_force * work;
  state.opening += slip * mode.a;
  state.sliding += slip * mode.b;
  state.progress = after;
}

// friction of a failed bond counts from where it failed, slides at its limit, and is forgotten when open: what its
// spring, whose stretch is kept, held when the bond was last closed is lost then
inline void rub(const Law &law, MixedState &state, bool just_failed, double opening, double sliding)
{
  if (just_failed) {
    state.sliding = sliding;
    state.opening = 0.0;
  }
  const double limit = law.friction * law.k_n * std::fmax(-opening, 0.0);
  const double shear = law.k_s * (sliding - state.sliding);
  const bool slips = std::fabs(shear) > limit;
  const double to = slips ? sliding - std::copysign(limit, shear) / law.k_s : state.sliding;
  state.used += limit > 0.0 ? limit * std::fabs(to - state.sliding) : 0.5 * law.k_s * state.opening * state.opening;
  state.sliding = to;
  state.opening = sliding - to;
}

inline void advance(const Law &law, MixedState &state, double opening, double sliding)
{
  if (!law.damageable()) return;
  const bool failed = has_failed(law, state);
  if (!failed) {
    if (law.elastic_unloading)
      yield_by(law, state, Mode(law, opening - state.opening, sliding - state.sliding));
    else
      damage_by(law, state, Mode(law, opening, sliding));
  }
  if (law.friction > 0.0 && has_failed(law, state)) rub(law, state, !failed, opening, sliding);
}

// forces of a bond whose state has been advanced to these openings
inline void forces(const Law &law, const MixedState &state, double opening, double sliding, double &normal,
                   double &shear)
{
  if (law.elastic_unloading) {
    normal = law.k_n * std::fmax(opening - state.opening, 0.0);
    shear = law.k_s * (sliding - state.sliding);
  } else {
    normal = (1.0 - state.progress) * law.k_n * opening;
    shear = (1.0 - state.progress) * law.k_s * sliding;
  }
  if (has_failed(law, state)) {
    normal = 0.0;
    shear = opening < 0.0 && law.friction > 0.0 ? law.k_s * (sliding - state.sliding) : 0.0;
  }
  if (opening < 0.0) normal = law.k_n * opening;
}

inline double stored(const Law &law, const MixedState &state, double opening, double sliding)
{
  double normal, shear;
  forces(law, state, opening, sliding, normal, shear);
  if (law.elastic_unloading) return 0.5 * (normal * normal / law.k_n + shear * shear / law.k_s);
  return 0.5 * (normal * opening + shear * (has_failed(law, state) ? shear / law.k_s : sliding));
}

// the largest opening that would have done the same in pure opening; 0 before any damage
inline double reached(const Law &law, const MixedState &state)
{
  if (!(state.progress > 0.0)) return 0.0;
  if (has_failed(law, state)) return law.delta_end();
  const double peak = law.delta_peak(), way = law.elastic_unloading
      ? state.progress
      : law.softening.way_of_damage(state.progress, law.delta_max / peak);
  return peak + way * (law.delta_max - peak);
}

inline double damage(const Law &law, const MixedState &state)
{
  return law.elastic_unloading ? law.damage(reached(law, state)) : state.progress;
}

}    // namespace cohesive

#endif
