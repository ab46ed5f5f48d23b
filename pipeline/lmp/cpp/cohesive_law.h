/* SPDX-License-Identifier: GPL-2.0-or-later
   The law of one bond type, and its closed form in pure opening; tension positive; no LAMMPS, no files.
   The same as cohesive.py. */

#ifndef COHESIVE_LAW_H
#define COHESIVE_LAW_H

#include "cohesive_softening.h"

#include <cmath>

namespace cohesive {

static constexpr int MOST_ARMS = 4;

// what one line of coefficients says
struct Law {
  double k_n = 0.0, f_max = INFINITY, delta_max = INFINITY;
  double k_s = 0.0, f_shear = INFINITY, delta_shear = INFINITY, friction = 0.0;
  Softening softening;
  bool elastic_unloading = false;
  int arms = 0;    // Maxwell arms of the rise: k_n is the sum of their stiffnesses and of what never relaxes
  double share[MOST_ARMS] = {0.0, 0.0, 0.0, 0.0}, time[MOST_ARMS] = {1.0, 1.0, 1.0, 1.0};

  bool slides() const { return k_s > 0.0; }
  bool creeps() const { return arms > 0; }
  bool damageable() const { return std::isfinite(f_max); }
  double delta_peak() const { return f_max / k_n; }
  double delta_end() const
  {
    return damageable() ? delta_max + (softening.end() - 1.0) * (delta_max - delta_peak()) : INFINITY;
  }

  // pure opening; the only history is the largest opening seen, `reached`
  double way(double reached) const
  {
    return reached > delta_peak() ? (reached - delta_peak()) / (delta_max - delta_peak()) : 0.0;
  }
  double envelope(double reached) const
  {
    return reached > delta_peak() ? f_max * softening.left(way(reached)) : k_n * std::fmax(reached, 0.0);
  }
  double secant(double reached) const { return reached > delta_peak() ? envelope(reached) / reached : k_n; }

  // unloading and reloading: max(slope (delta - plastic), 0), for openings up to limit
  double slope(double reached) const { return elastic_unloading ? k_n : secant(reached); }
  double plastic(double reached) const
  {
    return elastic_unloading && reached > delta_peak() ? reached - envelope(reached) / k_n : 0.0;
  }
  double limit(double reached) const { return damageable() ? std::fmax(reached, delta_peak()) : INFINITY; }

  // largest opening seen, noted only where it matters
  double grown(double opening, double reached) const { return opening > limit(reached) ? opening : reached; }

  // force at an opening that is not beyond `reached`, or has not left the elastic branch
  double tension(double opening, double reached) const
  {
    return std::fmax(slope(reached) * (opening - plastic(reached)), 0.0) + k_n * std::fmin(opening, 0.0);
  }
  double stored(double opening, double reached) const
  {
    const double force = tension(opening, reached);
    return 0.5 * force * (elastic_unloading ? force / k_n : opening);
  }
  double dissipated(double reached) const
  {
    if (!damageable() || reached <= delta_peak()) return 0.0;
    const double area = f_max * (delta_peak() / 2.0 + (delta_max - delta_peak()) * softening.area(way(reached)));
    const double force = envelope(reached);
    return area - 0.5 * force * (elastic_unloading ? force / k_n : reached);
  }
  double damage(double reached) const { return damageable() ? 1.0 - secant(reached) / k_n : 0.0; }
};

}    // namespace cohesive

#endif
