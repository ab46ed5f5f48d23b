// An image as an interpolating bicubic B-spline (Unser, Aldroubi & Eden 1993).
#pragma once
#include <cstddef>
#include <vector>

namespace dic {

class Spline {
 public:
  // `grey` is rows × columns, row by row; the border is mirrored at the outermost pixels.
  Spline(const float *grey, int rows, int columns);
  int rows() const { return rows_; }
  int columns() const { return columns_; }
  // The 4×4 coefficients of a point in [column, column+1) × [row, row+1) begin here; rows lie stride() apart.
  const float *stencil(int column, int row) const { return &coefficient_[(row + kPad - 1) * stride_ + column + kPad - 1]; }
  std::ptrdiff_t stride() const { return stride_; }
  // Value and derivatives at any point inside the image.
  void gradient(double column, double row, float &value, float &d_column, float &d_row) const;
  bool contains(double column, double row) const {
    return column >= 0 && row >= 0 && column <= columns_ - 1 && row <= rows_ - 1;
  }

 private:
  static constexpr int kPad = 2;
  int rows_, columns_;
  std::ptrdiff_t stride_;
  std::vector<float> coefficient_;
};

}  // namespace dic
