// A speckle pattern that is known everywhere: the sum of Gaussian blobs.
#pragma once
#include <cstddef>
#include <vector>

namespace dic {

struct Blob {
  double column, row, sigma, grey;
};

class Pattern {
 public:
  explicit Pattern(std::vector<Blob> blobs);
  // Grey value of the pattern (without background) at n points, given as column, row pairs.
  void evaluate(const double *points, std::size_t n, float *grey, int threads) const;

 private:
  static constexpr double kReach = 5.0;  // in sigma: what is cut off is below 4e-6 of the blob
  static constexpr double kCell = 8.0;   // px
  static constexpr double kMostCells = 1 << 30;
  double grey_at(double column, double row) const;
  std::vector<Blob> blobs_;
  std::vector<std::size_t> start_;  // of each cell among the members
  std::vector<int> member_;         // blobs that reach into each cell
  double column0_ = 0, row0_ = 0;
  int columns_ = 0, rows_ = 0;
};

}  // namespace dic
