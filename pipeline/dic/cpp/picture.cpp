#include "picture.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace dic {
namespace {

// Visit the pixels beside one, and itself, as far as they lie in the picture.
template <class Visit> void around(int column, int row, int columns, int rows, const Visit &visit) {
  for (int r = std::max(row - 1, 0); r <= std::min(row + 1, rows - 1); ++r)
    for (int c = std::max(column - 1, 0); c <= std::min(column + 1, columns - 1); ++c)
      visit(static_cast<std::size_t>(r) * columns + c);
}

// Saturated pixels that stand out, as defects of the sensor do, get the largest value beside them, so that the spline
// does not swing around them.
std::vector<float> calmed(const float *grey, int rows, int columns, float ceiling) {
  const std::size_t n = static_cast<std::size_t>(rows) * columns;
  std::vector<float> out(grey, grey + n);
  if (std::isinf(ceiling)) return out;
  const float bright = float(0.75 * ceiling + 0.25 * std::accumulate(grey, grey + n, 0.0) / n);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const std::size_t here = static_cast<std::size_t>(r) * columns + c;
      if (grey[here] < ceiling) continue;
      float largest = std::numeric_limits<float>::lowest();
      around(c, r, columns, rows, [&](std::size_t i) {
        if (grey[i] < ceiling) largest = std::max(largest, grey[i]);
      });
      if (largest > std::numeric_limits<float>::lowest() && largest < bright) out[here] = largest;
    }
  return out;
}

}  // namespace

Picture::Picture(const float *grey, int rows, int columns, float floor, float ceiling)
    : grey_(calmed(grey, rows, columns, ceiling)), spline_(grey_.data(), rows, columns), d_column_(grey_.size()),
      d_row_(grey_.size()) {
  const std::ptrdiff_t s = spline_.stride();
  for (int r = 0; r < rows; ++r) {
    const float *p = spline_.stencil(0, r) + s + 1;  // the coefficient of the pixel itself
    float *along = &d_column_[index(0, r)], *down = &d_row_[index(0, r)];
    for (int c = 0; c < columns; ++c, ++p) {  // derivative (−1, 0, 1)/2 one way, (1, 4, 1)/6 the other
      along[c] = ((p[1 - s] - p[-1 - s]) + 4 * (p[1] - p[-1]) + (p[1 + s] - p[-1 + s])) / 12;
      down[c] = ((p[s - 1] - p[-s - 1]) + 4 * (p[s] - p[-s]) + (p[s + 1] - p[-s + 1])) / 12;
    }
  }
  set_limits(grey, floor, ceiling);
}

void Picture::set_limits(const float *grey, float floor, float ceiling) {
  for (int r = 0; r < rows(); ++r)
    for (int c = 0; c < columns(); ++c) {
      const float here = grey[index(c, r)];
      if (here > floor && here < ceiling) continue;
      if (limit_.empty()) limit_.assign(grey_.size(), 0);
      if (here <= floor) limit_[index(c, r)] |= kDark;
      else around(c, r, columns(), rows(), [&](std::size_t i) { limit_[i] |= kBlind; });
    }
  if (limit_.empty()) return;
  tile_.assign(static_cast<std::size_t>(tile_columns()) * ((rows() + kTile - 1) / kTile), 0);
  for (int r = 0; r < rows(); ++r)
    for (int c = 0; c < columns(); ++c)
      if (limit_[index(c, r)]) tile_[static_cast<std::size_t>(r / kTile) * tile_columns() + c / kTile] = 1;
}

bool Picture::limited(double column, double row, double reach) const {
  if (limit_.empty() || !(std::abs(column) < 1e9 && std::abs(row) < 1e9)) return false;
  const auto tile = [](double x, int n) { return std::min(std::max(int(x), 0), n - 1) / kTile; };
  for (int r = tile(row - reach, rows()); r <= tile(row + reach, rows()); ++r)
    for (int c = tile(column - reach, columns()); c <= tile(column + reach, columns()); ++c)
      if (tile_[static_cast<std::size_t>(r) * tile_columns() + c]) return true;
  return false;
}

}  // namespace dic
