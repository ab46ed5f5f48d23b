#include "pattern.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "parallel.hpp"

namespace dic {

Pattern::Pattern(std::vector<Blob> blobs) : blobs_(std::move(blobs)) {
  if (blobs_.empty()) return;
  double low[2] = {std::numeric_limits<double>::max(), std::numeric_limits<double>::max()};
  double high[2] = {-low[0], -low[1]};
  for (const Blob &b : blobs_) {
    const double reach = kReach * b.sigma, at[2] = {b.column, b.row};
    for (int k = 0; k < 2; ++k) low[k] = std::min(low[k], at[k] - reach), high[k] = std::max(high[k], at[k] + reach);
  }
  column0_ = low[0], row0_ = low[1];
  if (!(((high[0] - low[0]) / kCell + 2) * ((high[1] - low[1]) / kCell + 2) < kMostCells))
    throw std::invalid_argument("the blobs of a pattern lie too far apart, or are too large");
  columns_ = static_cast<int>((high[0] - low[0]) / kCell) + 1;
  rows_ = static_cast<int>((high[1] - low[1]) / kCell) + 1;
  auto each_cell = [&](const Blob &b, auto &&visit) {
    const double reach = kReach * b.sigma;
    const int c0 = static_cast<int>((b.column - reach - column0_) / kCell);
    const int c1 = static_cast<int>((b.column + reach - column0_) / kCell);
    const int r0 = static_cast<int>((b.row - reach - row0_) / kCell);
    const int r1 = static_cast<int>((b.row + reach - row0_) / kCell);
    for (int r = std::max(r0, 0); r <= std::min(r1, rows_ - 1); ++r)
      for (int c = std::max(c0, 0); c <= std::min(c1, columns_ - 1); ++c) visit(r * columns_ + c);
  };
  start_.assign(static_cast<std::size_t>(columns_) * rows_ + 1, 0);
  for (const Blob &b : blobs_) each_cell(b, [&](int cell) { ++start_[cell + 1]; });
  for (std::size_t i = 1; i < start_.size(); ++i) start_[i] += start_[i - 1];
  member_.resize(start_.back());
  std::vector<std::size_t> fill(start_.begin(), start_.end() - 1);
  for (std::size_t i = 0; i < blobs_.size(); ++i)
    each_cell(blobs_[i], [&](int cell) { member_[fill[cell]++] = static_cast<int>(i); });
}

double Pattern::grey_at(double column, double row) const {
  const double c = (column - column0_) / kCell, r = (row - row0_) / kCell;
  if (!(c >= 0 && r >= 0 && c < columns_ && r < rows_)) return 0;
  const int cell = static_cast<int>(r) * columns_ + static_cast<int>(c);
  double sum = 0;
  for (std::size_t k = start_[cell]; k < start_[cell + 1]; ++k) {
    const Blob &b = blobs_[member_[k]];
    const double dc = column - b.column, dr = row - b.row;
    const double q = (dc * dc + dr * dr) / (b.sigma * b.sigma);
    if (q < kReach * kReach) sum += b.grey * std::exp(-0.5 * q);
  }
  return sum;
}

void Pattern::evaluate(const double *points, std::size_t n, float *grey, int threads) const {
  constexpr std::size_t kBatch = 4096;
  const int batches = static_cast<int>((n + kBatch - 1) / kBatch);
  parallel_for(batches, threads, [&](int batch, int) {
    const std::size_t stop = std::min(n, (batch + 1) * kBatch);
    for (std::size_t i = batch * kBatch; i < stop; ++i)
      grey[i] = static_cast<float>(grey_at(points[2 * i], points[2 * i + 1]));
  });
}

}  // namespace dic
