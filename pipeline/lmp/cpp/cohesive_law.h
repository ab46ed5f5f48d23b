/* SPDX-License-Identifier: GPL-2.0-or-later
   Linear softening between two particles in pure opening; tension positive; no LAMMPS, no files. */

#ifndef COHESIVE_LAW_H
#define COHESIVE_LAW_H

#include <cmath>

namespace cohesive {

// Elastic to f_max at delta_peak, straight to zero at delta_max, secant unloading, elastic compression.
// The only history is the largest opening seen, `reached`; f_max = inf never softens.
struct LinearSoftening {
  double k_n, f_max, delta_max;

  double delta_peak() const { return f_max / k_n; }
  bool damageable() const { return std::isfinite(f_max); }

  // force on the envelope at its largest opening
  double envelope(double reached) const
  {
    const double peak = delta_peak();
    if (reached <= peak) return k_n * reached;
    if (reached >= delta_max) return 0.0;
    return f_max * (delta_max - reached) / (delta_max - peak);
  }

  // slope of unloading and reloading
  double secant(double reached) const { return reached <= delta_peak() ? k_n : envelope(reached) / reached; }

  // opening beyond which the history grows
  double limit(double reached) const { return damageable() ? std::fmax(reached, delta_peak()) : INFINITY; }

  // largest opening seen, noted only where it matters
  double grown(double opening, double reached) const { return opening > limit(reached) ? opening : reached; }

  // force at an opening that is not beyond `reached`, or has not left the elastic branch
  double tension(double opening, double reached) const
  {
    return (opening < 0.0 ? k_n : secant(reached)) * opening;
  }

  double damage(double reached) const { return damageable() ? 1.0 - secant(reached) / k_n : 0.0; }

  double stored(double opening, double reached) const
  {
    return 0.5 * (opening < 0.0 ? k_n : secant(reached)) * opening * opening;
  }

  double dissipated(double reached) const
  {
    if (!damageable() || reached <= delta_peak()) return 0.0;
    const double seen = std::fmin(reached, delta_max);
    return 0.5 * (f_max * seen - envelope(seen) * delta_peak());
  }
};

}    // namespace cohesive

#endif
