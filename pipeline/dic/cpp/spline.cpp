#include "spline.hpp"

#include <algorithm>
#include <cmath>

namespace dic {
namespace {

constexpr float kPole = -0.26794919243112270647f;  // √3 − 2
constexpr int kHorizon = 16;                       // |pole|^16 < 1e-9: the mirrored sum may stop there

// The mirrored index of i in a line of n samples.
int mirrored(int i, int n) {
  if (n == 1) return 0;
  const int period = 2 * (n - 1);
  i = std::abs(i) % period;
  return i < n ? i : period - i;
}

// Filter `lines` adjacent lines at once: sample k of line j is at data[k * step + j].
void filter(float *data, int n, std::ptrdiff_t step, int lines) {
  std::vector<float> start(lines, 0.0f), end(lines);
  float power = 1;
  for (int k = 0; k < kHorizon; ++k, power *= kPole) {
    const float *line = data + mirrored(k, n) * step;
    for (int j = 0; j < lines; ++j) start[j] += power * line[j];
  }
  std::copy(start.begin(), start.end(), data);
  for (int k = 1; k < n; ++k) {
    float *line = data + k * step;
    for (int j = 0; j < lines; ++j) line[j] += kPole * line[j - step];
  }
  const float last = kPole / (kPole * kPole - 1);
  float *line = data + (n - 1) * step;
  if (n > 1)
    for (int j = 0; j < lines; ++j) line[j] = last * (line[j] + kPole * line[j - step]);
  for (int k = n - 2; k >= 0; --k) {
    line = data + k * step;
    for (int j = 0; j < lines; ++j) line[j] = kPole * (line[j + step] - line[j]);
  }
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < lines; ++j) data[k * step + j] *= 6;
}

}  // namespace

Spline::Spline(const float *grey, int rows, int columns)
    : rows_(rows), columns_(columns), stride_(columns + 2 * kPad),
      coefficient_(static_cast<std::size_t>(rows + 2 * kPad) * (columns + 2 * kPad)) {
  constexpr int kBand = 64;  // rows that are transposed together, so that the recursion runs along vectors
  float *const origin = &coefficient_[kPad * stride_ + kPad];
  std::vector<float> band(static_cast<std::size_t>(columns) * kBand);
  for (int first = 0; first < rows; first += kBand) {
    const int lines = std::min(kBand, rows - first);
    for (int j = 0; j < lines; ++j)
      for (int c = 0; c < columns; ++c) band[c * kBand + j] = grey[static_cast<std::size_t>(first + j) * columns + c];
    filter(band.data(), columns, kBand, lines);
    for (int j = 0; j < lines; ++j)
      for (int c = 0; c < columns; ++c) origin[(first + j) * stride_ + c] = band[c * kBand + j];
  }
  filter(origin, rows, stride_, columns);
  for (int r = -kPad; r < rows + kPad; ++r)
    for (int c = -kPad; c < columns + kPad; ++c)
      if (r < 0 || r >= rows || c < 0 || c >= columns)
        origin[r * stride_ + c] = origin[mirrored(r, rows) * stride_ + mirrored(c, columns)];
}

void Spline::gradient(double column, double row, float &value, float &d_column, float &d_row) const {
  const int c = std::min(static_cast<int>(column), columns_ - 1), r = std::min(static_cast<int>(row), rows_ - 1);
  float weight[2][4], slope[2][4];
  const double part[2] = {column - c, row - r};
  for (int k = 0; k < 2; ++k) {
    const float t = static_cast<float>(part[k]), s = 1 - t;
    weight[k][0] = s * s * s / 6, weight[k][3] = t * t * t / 6;
    weight[k][1] = 2.0f / 3 - t * t * (1 - t / 2), weight[k][2] = 2.0f / 3 - s * s * (1 - s / 2);
    slope[k][0] = -s * s / 2, slope[k][3] = t * t / 2;
    slope[k][1] = t * (1.5f * t - 2), slope[k][2] = -s * (1.5f * s - 2);
  }
  value = d_column = d_row = 0;
  const float *p = stencil(c, r);
  for (int j = 0; j < 4; ++j, p += stride_) {
    float along = 0, across = 0;
    for (int i = 0; i < 4; ++i) along += weight[0][i] * p[i], across += slope[0][i] * p[i];
    value += weight[1][j] * along, d_column += weight[1][j] * across, d_row += slope[1][j] * along;
  }
}

}  // namespace dic
