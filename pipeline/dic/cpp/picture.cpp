#include "picture.hpp"

namespace dic {

Picture::Picture(const float *grey, int rows, int columns)
    : spline_(grey, rows, columns), grey_(grey, grey + static_cast<std::size_t>(rows) * columns),
      d_column_(grey_.size()), d_row_(grey_.size()) {
  const std::ptrdiff_t s = spline_.stride();
  for (int r = 0; r < rows; ++r) {
    const float *p = spline_.stencil(0, r) + s + 1;  // the coefficient of the pixel itself
    float *along = &d_column_[index(0, r)], *down = &d_row_[index(0, r)];
    for (int c = 0; c < columns; ++c, ++p) {  // derivative (−1, 0, 1)/2 one way, (1, 4, 1)/6 the other
      along[c] = ((p[1 - s] - p[-1 - s]) + 4 * (p[1] - p[-1]) + (p[1 + s] - p[-1 + s])) / 12;
      down[c] = ((p[s - 1] - p[-s - 1]) + 4 * (p[s] - p[-s]) + (p[s + 1] - p[-s + 1])) / 12;
    }
  }
}

}  // namespace dic
