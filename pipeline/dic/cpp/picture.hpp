// A photograph, ready to be correlated: grey values, spline, gradients at the pixels.
#pragma once
#include <vector>

#include "spline.hpp"

namespace dic {

class Picture {
 public:
  Picture(const float *grey, int rows, int columns);
  const Spline &spline() const { return spline_; }
  int rows() const { return spline_.rows(); }
  int columns() const { return spline_.columns(); }
  const float *grey(int column, int row) const { return &grey_[index(column, row)]; }
  const float *d_column(int column, int row) const { return &d_column_[index(column, row)]; }
  const float *d_row(int column, int row) const { return &d_row_[index(column, row)]; }

 private:
  std::size_t index(int column, int row) const { return static_cast<std::size_t>(row) * columns() + column; }
  Spline spline_;
  std::vector<float> grey_, d_column_, d_row_;
};

}  // namespace dic
