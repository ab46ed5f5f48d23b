// Which triangle covers each node of a raster.
#pragma once
#include <cstddef>

namespace dic {

struct Raster {
  double column0, row0, step;
  int columns, rows;
};

// number[row * columns + column]: the last triangle that covers the raster's node, −1 where there is none. `corners` are
// column, row pairs, `triangles` three corners each.
void cover(const double *corners, const int *triangles, std::size_t count, const Raster &raster, int *number);

}  // namespace dic
