/* SPDX-License-Identifier: GPL-2.0-or-later
   Coefficients of a bond type as words, and what is wrong with them as a sentence; no LAMMPS, no files. */

#ifndef COHESIVE_COEFF_H
#define COHESIVE_COEFF_H

#include "cohesive_law.h"

#include <string>
#include <vector>

namespace cohesive {

// K_N F_MAX DELTA_MAX [shear K_S F_SHEAR DELTA_SHEAR] [softening linear|exponential|bilinear-tail TAIL]
//   [unloading secant|elastic] [friction MU] [relax N SHARE TIME ...]; an empty string, or what is wrong
std::string read_law(const std::vector<std::string> &words, Law &law);

// what is wrong with the values of a law, in the sentences of Python; an empty string where nothing is
std::string complaint(const Law &law);

// the words that read_law makes the law of
std::string write_law(const Law &law);

}    // namespace cohesive

#endif
