// Does a line part a subset whose affine match has converged? A score test for a jump, over all lines.
#pragma once
#include "subset.hpp"

namespace dic {

struct Suspicion {
  double score = 0;  // χ² with two degrees of freedom for one line; the greatest over the lines
  Line line;
  double jump_u = 0, jump_v = 0;  // displacement beyond the line minus that of the near side, to first order
};

// `error` as fit() leaves it in the bench; `variance` of the error of one pixel.
Suspicion screen(const Pixels &pixels, const float *error, const Fit &fit, double variance, int half);

// By how much second-order terms of the warp would lower Σ e²: what a smoothly bent field leaves over is no crack.
double bend(const Pixels &pixels, const float *error, const Fit &fit, int half);

}  // namespace dic
