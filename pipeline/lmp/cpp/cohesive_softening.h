/* SPDX-License-Identifier: GPL-2.0-or-later
   Shapes of the softening branch, all of the same area; no LAMMPS, no files. The same as softening.py. */

#ifndef COHESIVE_SOFTENING_H
#define COHESIVE_SOFTENING_H

#include <algorithm>
#include <cmath>

namespace cohesive {

// Share g(s) of the strength that is left along the way s = (delta - delta_peak)/(delta_max - delta_peak); the
// integral of g is 1/2 for every shape, so delta_max is where the linear branch of the same area ends.
struct Softening {
  enum Shape { LINEAR, EXPONENTIAL, BILINEAR_TAIL };
  static constexpr double EXPONENTIAL_END = 4.0, EXPONENTIAL_RATE = 1.9945269342442677;
  static constexpr double KINK_LEFT = 1.0 / 3.0;

  Shape shape = LINEAR;
  double tail = 1.0;    // of the bilinear branch: 0 linear ... 1 long (Petersson 1981)

  double kink() const { return 2.0 / 3.0 - 4.0 / 15.0 * tail; }
  double end() const
  {
    return shape == EXPONENTIAL ? EXPONENTIAL_END : shape == BILINEAR_TAIL ? 3.0 * (1.0 - kink()) : 1.0;
  }
  double first_slope() const { return (1.0 - KINK_LEFT) / kink(); }
  double second_slope() const { return KINK_LEFT / (end() - kink()); }

  double left(double s) const
  {
    if (s >= end()) return 0.0;
    double g = 1.0 - s;
    if (shape == EXPONENTIAL) {
      const double last = std::exp(-EXPONENTIAL_RATE * EXPONENTIAL_END);
      g = (std::exp(-EXPONENTIAL_RATE * s) - last) / (1.0 - last);
    } else if (shape == BILINEAR_TAIL) {
      g = s <= kink() ? 1.0 - first_slope() * s : second_slope() * (end() - s);
    }
    return std::clamp(g, 0.0, 1.0);
  }

  // integral of g from 0 to s
  double area(double s) const
  {
    s = std::clamp(s, 0.0, end());
    if (shape == LINEAR) return s - s * s / 2.0;
    if (shape == EXPONENTIAL) {
      const double last = std::exp(-EXPONENTIAL_RATE * EXPONENTIAL_END);
      return (-std::expm1(-EXPONENTIAL_RATE * s) / EXPONENTIAL_RATE - last * s) / (1.0 - last);
    }
    const double rest = end() - s;
    return s <= kink() ? s - first_slope() * s * s / 2.0 : 0.5 - second_slope() * rest * rest / 2.0;
  }

  // the way s at which 1 - g(s)/(1 + s (stretch - 1)) is the given damage
  double way_of_damage(double damage, double stretch) const
  {
    const double kept = 1.0 - damage, more = stretch - 1.0;
    if (shape == LINEAR) return (1.0 - kept) / (1.0 + kept * more);
    if (shape == EXPONENTIAL) return exponential_way(kept, more);
    const double near = (1.0 - kept) / (first_slope() + kept * more);
    return near <= kink() ? near : (second_slope() * end() - kept) / (second_slope() + kept * more);
  }

 private:
  // root of g(s) = kept (1 + s more): convex and falling, so Newton from s = 0 never overshoots
  static double exponential_way(double kept, double more)
  {
    if (kept <= 0.0) return EXPONENTIAL_END;
    const double last = std::exp(-EXPONENTIAL_RATE * EXPONENTIAL_END);
    double s = 0.0;
    for (int i = 0; i < 60; i++) {
      const double falling = std::exp(-EXPONENTIAL_RATE * s) / (1.0 - last);
      const double rest = falling - last / (1.0 - last) - kept * (1.0 + s * more);
      const double further = s + rest / (EXPONENTIAL_RATE * falling + kept * more);
      if (!(further > s)) break;
      s = further;
    }
    return std::min(s, EXPONENTIAL_END);
  }
};

}    // namespace cohesive

#endif
