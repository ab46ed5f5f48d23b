/* SPDX-License-Identifier: GPL-2.0-or-later
   Drives the law of the LAMMPS style along a path of openings, as its force loop does; called through ctypes. */

#include "cohesive_law.h"

extern "C" void follow(const double *k_n_f_max_delta_max, int steps, const double *opening, double *row)
{
  const cohesive::LinearSoftening law{k_n_f_max_delta_max[0], k_n_f_max_delta_max[1], k_n_f_max_delta_max[2]};
  double reached = 0.0;
  for (int i = 0; i < steps; i++, row += 5) {
    reached = law.grown(opening[i], reached);
    row[0] = law.tension(opening[i], reached);
    row[1] = reached;
    row[2] = law.stored(opening[i], reached);
    row[3] = law.dissipated(reached);
    row[4] = law.damage(reached);
  }
}
