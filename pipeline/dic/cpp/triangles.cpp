#include "triangles.hpp"

#include <algorithm>
#include <cmath>

namespace dic {

void cover(const double *corners, const int *triangles, std::size_t count, const Raster &raster, int *number) {
  std::fill_n(number, static_cast<std::size_t>(raster.columns) * raster.rows, -1);
  for (std::size_t t = 0; t < count; ++t) {
    double x[3], y[3];
    for (int k = 0; k < 3; ++k) {
      x[k] = (corners[2 * triangles[3 * t + k]] - raster.column0) / raster.step;
      y[k] = (corners[2 * triangles[3 * t + k] + 1] - raster.row0) / raster.step;
    }
    const double area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
    if (!(std::abs(area) > 0)) continue;
    auto low = [](const double *v) { return std::min({v[0], v[1], v[2]}); };
    auto high = [](const double *v) { return std::max({v[0], v[1], v[2]}); };
    const int c0 = std::max(0, int(std::ceil(low(x)))), c1 = std::min(raster.columns - 1, int(std::floor(high(x))));
    const int r0 = std::max(0, int(std::ceil(low(y)))), r1 = std::min(raster.rows - 1, int(std::floor(high(y))));
    for (int r = r0; r <= r1; ++r)
      for (int c = c0; c <= c1; ++c) {
        const double a = ((x[1] - c) * (y[2] - r) - (x[2] - c) * (y[1] - r)) / area;
        const double b = ((x[2] - c) * (y[0] - r) - (x[0] - c) * (y[2] - r)) / area;
        if (a >= -1e-12 && b >= -1e-12 && a + b <= 1 + 1e-12)
          number[static_cast<std::size_t>(r) * raster.columns + c] = static_cast<int>(t);
      }
  }
}

}  // namespace dic
