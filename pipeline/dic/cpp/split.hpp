// A subset cut by a straight line: the line is searched over all angles and offsets, each part has its own warp.
#pragma once
#include <cstddef>
#include <vector>

#include "screen.hpp"

namespace dic {

constexpr std::size_t kMostCandidates = 15;

// A motion seen near the subset, with the brightness it came with and where it was seen from the centre; NaN where
// it is the subset's own.
struct Candidate {
  Warp warp;
  double gain = 1, offset = 0, xi = 0, eta = 0;
};

struct SplitResult {
  bool attempted = false;
  Line line;
  Fit near, far;
  int near_count = 0, far_count = 0;
  double margin = 0;         // px, of the band along the line that the near part leaves out
  bool far_matched = false;
  double single = 0;         // cost of the best single warp: Σ min(e²/σ², clip) over the subset
  double parted = 0;         // cost of the two warps on both sides of the line
  double swapped = 0;        // least cost of a line that puts the centre on the other side
  Suspicion near_second, far_second;  // is there a second line through either part?
};

struct SplitSettings {
  Settings fit;
  double clip = 16;  // of e²/σ²: no pixel counts for more
  int rounds = 4;
};

// Scratch memory of one thread.
struct SplitBench {
  Pixels all, part;
  Bench bench;
  std::vector<float> distance, cost, strips;
};

// `variance`: expected square of e at one pixel. `from`, `far_from`, `line` as in gather(), for a carried reference.
SplitResult split(const Picture &reference, const Picture &current, Point centre,
                  const std::vector<Candidate> &candidates, double variance, const SplitSettings &settings,
                  const Warp *from, const Warp *far_from, const Line *known, SplitBench &work);

}  // namespace dic
