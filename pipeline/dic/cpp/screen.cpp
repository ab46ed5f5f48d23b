#include "screen.hpp"

#include <cmath>

#include "lanes.hpp"
#include "linear.hpp"

namespace dic {
namespace {

constexpr int kAngles = 12;         // half a turn in steps of 15°
constexpr double kWidth = 1.5;      // px between the lines that are tried
constexpr double kLeast = 24;       // pixels on either side
constexpr double kPi = 3.14159265358979323846;

// What is summed over one side of a line: score (2), gradient products times 1, ξ, η (9), pixels (1), gradients times
// 1 and f̃ (4).
enum Sum { XE, YE, XX, XY, YY, XXxi, XYxi, YYxi, XXeta, XYeta, YYeta, Count, X, Y, XF, YF };

void terms(const Pixels &p, const float *error, const Fit &fit, std::vector<float> &out) {
  double along = 0;
  for (int i = 0; i < p.count; ++i) along += error[i] * (p.grey[i] - fit.grey);
  const float share = float(along / fit.contrast);
  out.assign(static_cast<std::size_t>(p.count) * kLanes, 0.0f);
  for (int i = 0; i < p.count; ++i) {
    const float dx = p.dx[i], dy = p.dy[i], e = error[i], xi = p.xi[i], eta = p.eta[i];
    const float f = p.grey[i] - float(fit.grey), left = e - share * f;
    float *q = &out[static_cast<std::size_t>(i) * kLanes];
    q[XE] = dx * left, q[YE] = dy * left;
    q[X] = dx, q[Y] = dy, q[XF] = dx * f, q[YF] = dy * f;
    q[XX] = dx * dx, q[XY] = dx * dy, q[YY] = dy * dy;
    for (int k = 0; k < 3; ++k) q[XXxi + k] = q[XX + k] * xi, q[XXeta + k] = q[XX + k] * eta;
    q[Count] = 1;
  }
}

DIC_CLONES void gather_strips(const Pixels &p, const float *terms, float nx, float ny, float reach, float *strips) {
  for (int i = 0; i < p.count; ++i) {
    const int strip = int((nx * p.xi[i] + ny * p.eta[i] + reach) * float(1 / kWidth));
    *lanes(strips + strip * kLanes) += *lanes(terms + i * kLanes);
  }
}

// χ² of a jump on the side whose sums are given; what affine, brightness and contrast changes explain is taken out.
double chi_square(const float *s, const Fit &fit, int count, double &ju, double &jv) {
  double c[2][6] = {{s[XX], s[XY], s[XXxi], s[XXeta], s[XYxi], s[XYeta]},
                    {s[XY], s[YY], s[XYxi], s[XYeta], s[YYxi], s[YYeta]}};
  double v[2][2] = {{s[XX], s[XY]}, {s[XY], s[YY]}};
  for (int i = 0; i < 2; ++i)
    for (int k = 0; k < 6; ++k) c[i][k] -= s[X + i] * fit.mean[k] + s[XF + i] * fit.along[k];
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) v[i][j] -= s[X + i] * s[X + j] / count + s[XF + i] * s[XF + j] / fit.contrast;
  for (int i = 0; i < 2; ++i)
    for (int k = 0; k < 6; ++k) {
      double t = 0;
      for (int l = 0; l < 6; ++l) t += fit.inverse[k * 6 + l] * c[i][l];
      for (int j = 0; j < 2; ++j) v[i][j] -= t * c[j][k];
    }
  const double det = v[0][0] * v[1][1] - v[0][1] * v[1][0];
  if (!(det > 1e-4 * s[XX] * s[YY])) return 0;
  ju = -(v[1][1] * s[XE] - v[0][1] * s[YE]) / det, jv = -(v[0][0] * s[YE] - v[1][0] * s[XE]) / det;
  return -(ju * s[XE] + jv * s[YE]);
}

// The line with its normal turned so that the centre lies on the near side; the jump follows.
void orient(Suspicion &s) {
  if (s.line.offset >= 0) return;
  s.line = {s.line.angle + kPi, -s.line.offset};
  s.jump_u = -s.jump_u, s.jump_v = -s.jump_v;
}

}  // namespace

Suspicion screen(const Pixels &pixels, const float *error, const Fit &fit, double variance, int half) {
  std::vector<float> each, strips;
  terms(pixels, error, fit, each);
  const double reach = half * std::sqrt(2.0) + kWidth;
  const int count = int(2 * reach / kWidth) + 1;
  Suspicion worst;
  if (!(variance > 0)) return worst;
  for (int a = 0; a < kAngles; ++a) {
    const double angle = a * kPi / kAngles;
    strips.assign(static_cast<std::size_t>(count) * kLanes, 0.0f);
    gather_strips(pixels, each.data(), float(std::cos(angle)), float(std::sin(angle)), float(reach), strips.data());
    float side[kLanes] = {};  // beyond the line
    for (int k = count - 1; k > 0; --k) {
      *lanes(side) += *lanes(&strips[static_cast<std::size_t>(k) * kLanes]);
      if (side[Count] < kLeast || side[Count] > pixels.count - kLeast) continue;
      double ju = 0, jv = 0;
      const double score = chi_square(side, fit, pixels.count, ju, jv) / variance;
      if (score > worst.score) worst = {score, {angle, k * kWidth - reach}, ju, jv};
    }
  }
  orient(worst);
  return worst;
}

double bend(const Pixels &p, const float *error, const Fit &fit, int half) {
  double score[6] = {}, matrix[36] = {}, affine[6][6] = {}, level[6] = {}, contrast[6] = {};
  for (int i = 0; i < p.count; ++i) {
    const double dx = p.dx[i], dy = p.dy[i], xi = p.xi[i], eta = p.eta[i], f = p.grey[i] - fit.grey;
    const double a = xi * xi / (half * half), b = xi * eta / (half * half), c = eta * eta / (half * half);
    const double q[6] = {dx * a, dx * b, dx * c, dy * a, dy * b, dy * c};
    const double j[6] = {dx, dy, dx * xi, dx * eta, dy * xi, dy * eta};
    for (int k = 0; k < 6; ++k) {
      score[k] += q[k] * error[i], level[k] += q[k], contrast[k] += q[k] * f;
      for (int l = 0; l < 6; ++l) matrix[6 * k + l] += q[k] * q[l], affine[k][l] += q[k] * j[l];
    }
  }
  for (int k = 0; k < 6; ++k)
    for (int l = 0; l < 6; ++l) affine[k][l] -= level[k] * fit.mean[l] + contrast[k] * fit.along[l];
  for (int k = 0; k < 6; ++k) {
    double t[6] = {};
    for (int m = 0; m < 6; ++m)
      for (int n = 0; n < 6; ++n) t[m] += fit.inverse[6 * m + n] * affine[k][n];
    for (int l = 0; l < 6; ++l) {
      matrix[6 * k + l] -= level[k] * level[l] / p.count + contrast[k] * contrast[l] / fit.contrast;
      for (int m = 0; m < 6; ++m) matrix[6 * k + l] -= t[m] * affine[l][m];
    }
  }
  double inverse[36], drop = 0;
  if (!invert_symmetric(matrix, 6, 6, inverse)) return 0;
  for (int k = 0; k < 6; ++k)
    for (int l = 0; l < 6; ++l) drop += score[k] * inverse[6 * k + l] * score[l];
  return drop;
}

}  // namespace dic
