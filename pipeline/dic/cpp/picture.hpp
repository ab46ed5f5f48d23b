// A photograph, ready to be correlated: grey values, spline, gradients at the pixels.
#pragma once
#include <cstdint>
#include <vector>

#include "spline.hpp"

namespace dic {

class Picture {
 public:
  // Pixels at the ceiling or above are saturated, those at the floor or below dark: they say nothing of the light, and
  // the spline beside a saturated one says little.
  Picture(const float *grey, int rows, int columns, float floor, float ceiling);
  const Spline &spline() const { return spline_; }
  int rows() const { return spline_.rows(); }
  int columns() const { return spline_.columns(); }
  const float *grey(int column, int row) const { return &grey_[index(column, row)]; }
  const float *d_column(int column, int row) const { return &d_column_[index(column, row)]; }
  const float *d_row(int column, int row) const { return &d_row_[index(column, row)]; }
  // May any pixel of a square around a place be blind or dark? (Never no where one is.)
  bool limited(double column, double row, double reach) const;
  // Of the nearest pixel of a place inside the picture:
  bool blind(double column, double row) const { return limit_at(column, row) & kBlind; }
  bool dark(double column, double row) const { return limit_at(column, row) & kDark; }

 private:
  enum : std::uint8_t { kBlind = 1, kDark = 2 };  // blind: saturated, or beside such a pixel
  static constexpr int kTile = 8;
  int tile_columns() const { return (columns() + kTile - 1) / kTile; }
  std::uint8_t limit_at(double column, double row) const {
    return !limit_.empty() ? limit_[index(static_cast<int>(column + 0.5), static_cast<int>(row + 0.5))] : 0;
  }
  void set_limits(const float *grey, float floor, float ceiling);
  std::size_t index(int column, int row) const { return static_cast<std::size_t>(row) * columns() + column; }
  std::vector<float> grey_;
  Spline spline_;
  std::vector<float> d_column_, d_row_;
  std::vector<std::uint8_t> limit_;  // sums of kBlind and kDark; empty where there are none
  std::vector<std::uint8_t> tile_;   // of kTile × kTile pixels: is there any?
};

}  // namespace dic
