// Reliability-guided propagation: each point starts from the warp of its best neighbour that is done.
#pragma once
#include <vector>

#include "screen.hpp"

namespace dic {

struct Task {
  const Picture *reference, *current;
  std::vector<Point> points;
  const int *neighbours;  // points × 8, −1 for none
  const Warp *from;       // where the reference has carried the points, or null
  Settings settings;
  double accept;          // least ZNCC of a point that hands its warp on
  int threads;
};

struct PointResult {
  Fit fit;
  Suspicion suspicion;
  double bend = 0;  // see screen.hpp; only where the score gives reason to ask
  int count = 0;
  bool reached = false;
};

// `seeds` with their guesses; results for every point. The result does not depend on the number of threads.
std::vector<PointResult> propagate(const Task &task, const std::vector<int> &seeds, const std::vector<Warp> &guesses);

// Each point from its own guess, without propagation.
std::vector<PointResult> match(const Task &task, const Warp *guesses);

}  // namespace dic
