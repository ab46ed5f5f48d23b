#include "subset.hpp"

#include <algorithm>
#include <cmath>

#include "lanes.hpp"
#include "linear.hpp"
#include "seen.hpp"

namespace dic {

Warp after_inverse(const Warp &w, const Warp &step) {
  const double a = 1 + step.ux, b = step.uy, c = step.vx, d = 1 + step.vy, det = a * d - b * c;
  const double ia = d / det, ib = -b / det, ic = -c / det, id = a / det;
  const double iu = -(ia * step.u + ib * step.v), iv = -(ic * step.u + id * step.v);
  const double wa = 1 + w.ux, wd = 1 + w.vy;
  return {w.u + wa * iu + w.uy * iv,     w.v + w.vx * iu + wd * iv,
          wa * ia + w.uy * ic - 1,       wa * ib + w.uy * id,
          w.vx * ia + wd * ic,           w.vx * ib + wd * id - 1};
}

void Pixels::resize(int n) {
  count = n, padded = (n + kLanes - 1) / kLanes * kLanes;
  for (auto *v : {&xi, &eta, &grey, &dx, &dy, &mask}) v->assign(padded, 0.0f);
}

void Pixels::keep(const std::vector<float> &signed_distance, double margin, Pixels &kept) const {
  kept = *this;
  int k = 0;
  for (int i = 0; i < count; ++i)
    if (signed_distance[i] < -margin) kept.move(i, k++);
  kept.shrink(k);
}

void Pixels::move(int from, int to) {
  for (auto *v : {&xi, &eta, &grey, &dx, &dy, &mask}) (*v)[to] = (*v)[from];
  for (auto *v : {&blind, &dark})
    if (!v->empty()) (*v)[to] = (*v)[from];
}

void Pixels::shrink(int n) {
  count = n, padded = (n + kLanes - 1) / kLanes * kLanes;
  for (auto *v : {&xi, &eta, &grey, &dx, &dy, &mask}) {
    v->resize(padded);
    std::fill(v->begin() + n, v->end(), 0.0f);
  }
  for (auto *v : {&blind, &dark})
    if (!v->empty()) v->resize(n);
}

void Bench::resize(int padded) {
  if (static_cast<int>(cell.size()) >= padded) return;
  for (auto *v : {&sampled, &error, &tx, &ty}) v->resize(padded);
  cell.resize(padded);
}

namespace {

// The subset lies on whole pixels: read values and gradients.
bool read(const Picture &picture, int column, int row, int half, Pixels &out) {
  if (column < half || row < half || column + half >= picture.columns() || row + half >= picture.rows()) return false;
  const int side = 2 * half + 1;
  int k = 0;
  for (int j = 0; j < side; ++j) {
    const int r = row - half + j, c = column - half;
    std::copy_n(picture.grey(c, r), side, &out.grey[k]);
    std::copy_n(picture.d_column(c, r), side, &out.dx[k]);
    std::copy_n(picture.d_row(c, r), side, &out.dy[k]);
    for (int i = 0; i < side; ++i, ++k) {
      out.xi[k] = float(i - half), out.eta[k] = float(j - half), out.mask[k] = 1;
      if (!out.blind.empty()) out.blind[k] = picture.blind(c + i, r), out.dark[k] = picture.dark(c + i, r);
    }
  }
  return true;
}

// The subset lies anywhere and is deformed: gradients turn into those over ξ and η by the chain rule.
bool carry(const Picture &picture, Point centre, int half, const Warp &near, const Warp *far, const Line *line,
           Pixels &out) {
  const double nx = line ? std::cos(line->angle) : 0, ny = line ? std::sin(line->angle) : 0;
  int k = 0;
  for (int eta = -half; eta <= half; ++eta)
    for (int xi = -half; xi <= half; ++xi) {
      const bool beyond = line && far && nx * xi + ny * eta > line->offset;
      const Warp &w = beyond ? *far : near;
      const double c = centre.column + xi + w.u + w.ux * xi + w.uy * eta;
      const double r = centre.row + eta + w.v + w.vx * xi + w.vy * eta;
      if (!picture.spline().contains(c, r)) {
        if (!beyond) return false;
        continue;  // the part beyond the line may leave the picture
      }
      out.xi[k] = float(xi), out.eta[k] = float(eta);
      if (!out.blind.empty()) out.blind[k] = picture.blind(c, r), out.dark[k] = picture.dark(c, r);
      float dc, dr;
      picture.spline().gradient(c, r, out.grey[k], dc, dr);
      out.dx[k] = float(dc * (1 + w.ux) + dr * w.vx), out.dy[k] = float(dc * w.uy + dr * (1 + w.vy));
      out.mask[k++] = 1;
    }
  out.shrink(k);
  return true;
}

bool whole(double x) { return x == std::floor(x); }

}  // namespace

bool gather(const Picture &picture, Point centre, int half, const Warp *from, const Warp *far, const Line *line,
            Pixels &out) {
  const int side = 2 * half + 1;
  out.resize(side * side);
  const bool limited = limited_about(picture, centre, from ? *from : Warp{}, half) ||
                       (far && limited_about(picture, centre, *far, half));
  for (auto *v : {&out.blind, &out.dark}) v->assign(limited ? side * side : 0, 0);
  if (!from && whole(centre.column) && whole(centre.row))
    return read(picture, int(centre.column), int(centre.row), half, out);
  return carry(picture, centre, half, from ? *from : Warp{}, far, line, out);
}

DIC_CLONES bool sample(const Spline &spline, const Pixels &pixels, Point centre, const Warp &warp, Bench &bench) {
  bench.resize(pixels.padded);
  const double column = centre.column + warp.u, row = centre.row + warp.v;
  const double reach = 1e6;
  if (!(std::abs(column) < reach && std::abs(row) < reach)) return false;
  const int column0 = int(std::floor(column)), row0 = int(std::floor(row));
  const float u = float(column - column0), v = float(row - row0);
  const float xx = float(1 + warp.ux), xy = float(warp.uy), yx = float(warp.vx), yy = float(1 + warp.vy);
  const float *xi = pixels.xi.data(), *eta = pixels.eta.data(), *mask = pixels.mask.data();
  float *tx = bench.tx.data(), *ty = bench.ty.data();
  int *cell = bench.cell.data();
  const int padded = pixels.padded, stride = int(spline.stride());
  constexpr float kShift = 1024;  // makes the cast to int round downwards
  int low_c = 1 << 30, low_r = 1 << 30, high_c = -(1 << 30), high_r = -(1 << 30);
  for (int i = 0; i < padded; ++i) {
    const float x = mask[i] * (u + xx * xi[i] + xy * eta[i]), y = mask[i] * (v + yx * xi[i] + yy * eta[i]);
    const int c = int(x + kShift) - int(kShift), r = int(y + kShift) - int(kShift);
    tx[i] = x - float(c), ty[i] = y - float(r), cell[i] = r * stride + c;
    low_c = std::min(low_c, c), high_c = std::max(high_c, c);
    low_r = std::min(low_r, r), high_r = std::max(high_r, r);
  }
  if (column0 + low_c < 0 || row0 + low_r < 0 || column0 + high_c > spline.columns() - 2 ||
      row0 + high_r > spline.rows() - 2 || low_c < -int(kShift) || low_r < -int(kShift))
    return false;
  const float *origin = spline.stencil(column0, row0);
  constexpr float s = 1.0f / 6;
  const Four a = {-s, 3 * s, -3 * s, s}, b = {3 * s, -6 * s, 3 * s, 0}, c = {-3 * s, 0, 3 * s, 0}, d = {s, 4 * s, s, 0};
  float *out = bench.sampled.data();
  for (int i = 0; i < padded; ++i) {
    const float *p = origin + cell[i];
    const Four wx = ((a * tx[i] + b) * tx[i] + c) * tx[i] + d;
    const Four wy = ((a * ty[i] + b) * ty[i] + c) * ty[i] + d;
    const Four sum = wy[0] * *reinterpret_cast<const Four *>(p) + wy[1] * *reinterpret_cast<const Four *>(p + stride) +
                     wy[2] * *reinterpret_cast<const Four *>(p + 2 * stride) +
                     wy[3] * *reinterpret_cast<const Four *>(p + 3 * stride);
    const Four product = sum * wx;
    out[i] = (product[0] + product[1]) + (product[2] + product[3]);
  }
  return true;
}

namespace {

struct Level {
  double mean, norm;
};

DIC_CLONES Level level(const float *values, const float *mask, int padded, int count) {
  Lanes sum{};
  for (int i = 0; i < padded; i += kLanes) sum += *lanes(values + i) * *lanes(mask + i);
  const double mean = DIC_SUM(sum) / count;
  Lanes square{};
  for (int i = 0; i < padded; i += kLanes) {
    const Lanes d = (*lanes(values + i) - float(mean)) * *lanes(mask + i);
    square += d * d;
  }
  return {mean, std::sqrt(DIC_SUM(square))};
}

struct Curvature {
  double hessian[36];  // of the warp, brightness and contrast projected out
  double mean[6], along[6];  // Σ J / n and Σ J f̃ / |f̃|²
};

DIC_CLONES void curvature(const Pixels &p, const Level &f, Curvature &out) {
  Lanes xx[6]{}, xy[6]{}, yy[6]{}, jm[6]{}, jf[6]{};
  for (int i = 0; i < p.padded; i += kLanes) {
    const Lanes dx = *lanes(&p.dx[i]), dy = *lanes(&p.dy[i]), xi = *lanes(&p.xi[i]), eta = *lanes(&p.eta[i]);
    const Lanes grey = (*lanes(&p.grey[i]) - float(f.mean)) * *lanes(&p.mask[i]);
    const Lanes a = dx * dx, b = dx * dy, c = dy * dy, q = xi * xi, r = xi * eta, s = eta * eta;
    xx[0] += a, xx[1] += a * xi, xx[2] += a * eta, xx[3] += a * q, xx[4] += a * r, xx[5] += a * s;
    xy[0] += b, xy[1] += b * xi, xy[2] += b * eta, xy[3] += b * q, xy[4] += b * r, xy[5] += b * s;
    yy[0] += c, yy[1] += c * xi, yy[2] += c * eta, yy[3] += c * q, yy[4] += c * r, yy[5] += c * s;
    const Lanes j[6] = {dx, dy, dx * xi, dx * eta, dy * xi, dy * eta};
    for (int k = 0; k < 6; ++k) jm[k] += j[k], jf[k] += j[k] * grey;
  }
  double a[6], b[6], c[6];
  for (int k = 0; k < 6; ++k) {
    a[k] = DIC_SUM(xx[k]), b[k] = DIC_SUM(xy[k]), c[k] = DIC_SUM(yy[k]);
    out.mean[k] = DIC_SUM(jm[k]) / p.count, out.along[k] = DIC_SUM(jf[k]) / (f.norm * f.norm);
  }
  const double upper[6][6] = {{a[0], b[0], a[1], a[2], b[1], b[2]}, {0, c[0], b[1], b[2], c[1], c[2]},
                              {0, 0, a[3], a[4], b[3], b[4]},       {0, 0, 0, a[5], b[4], b[5]},
                              {0, 0, 0, 0, c[3], c[4]},             {0, 0, 0, 0, 0, c[5]}};
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j)
      out.hessian[i * 6 + j] = out.hessian[j * 6 + i] =
          upper[i][j] - p.count * out.mean[i] * out.mean[j] - f.norm * f.norm * out.along[i] * out.along[j];
}

// e = f̃ − (|f̃|/|g̃|) g̃; returns Σ e², fills the score Σ J e and Σ f̃ e.
DIC_CLONES double score(const Pixels &p, const Level &f, const Level &g, Bench &bench, double *out, double &along) {
  const float ratio = float(f.norm / g.norm), fm = float(f.mean), gm = float(g.mean);
  Lanes sum[6]{}, square{}, projected{};
  for (int i = 0; i < p.padded; i += kLanes) {
    const Lanes grey = (*lanes(&p.grey[i]) - fm) * *lanes(&p.mask[i]);
    const Lanes e = grey - ratio * (*lanes(&bench.sampled[i]) - gm) * *lanes(&p.mask[i]);
    *lanes(&bench.error[i]) = e;
    square += e * e, projected += grey * e;
    const Lanes xe = *lanes(&p.dx[i]) * e, ye = *lanes(&p.dy[i]) * e, xi = *lanes(&p.xi[i]), eta = *lanes(&p.eta[i]);
    sum[0] += xe, sum[1] += ye, sum[2] += xe * xi, sum[3] += xe * eta, sum[4] += ye * xi, sum[5] += ye * eta;
  }
  for (int k = 0; k < 6; ++k) out[k] = DIC_SUM(sum[k]);
  along = DIC_SUM(projected);
  return DIC_SUM(square);
}

// Columns of the warps that a model allows: p = B q.
int basis(Model model, double (&b)[6][6]) {
  if (model == Model::Rigid) {
    b[0][0] = b[1][1] = 1, b[3][2] = -1, b[4][2] = 1;  // small rotation: u_y = −ω, v_x = ω
    return 3;
  }
  const int n = model == Model::Affine ? 6 : 2;
  for (int i = 0; i < n; ++i) b[i][i] = 1;
  return n;
}

// B (Bᵀ H B)⁻¹ Bᵀ.
bool reduced_inverse(const double *hessian, Model model, double *out) {
  double b[6][6]{}, small[36], inverse[36];
  const int n = basis(model, b);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      double s = 0;
      for (int k = 0; k < 6; ++k)
        for (int l = 0; l < 6; ++l) s += b[k][i] * hessian[k * 6 + l] * b[l][j];
      small[i * 6 + j] = s;
    }
  if (!invert_symmetric(small, n, 6, inverse)) return false;
  for (int k = 0; k < 6; ++k)
    for (int l = 0; l < 6; ++l) {
      double s = 0;
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) s += b[k][i] * inverse[i * 6 + j] * b[l][j];
      out[k * 6 + l] = s;
    }
  return true;
}

// A rigid warp stays a rotation after the composition.
Warp as_rotation(const Warp &w) {
  const double angle = std::atan2(w.vx - w.uy, 2 + w.ux + w.vy), c = std::cos(angle), s = std::sin(angle);
  return {w.u, w.v, c - 1, -s, s, c - 1};
}

}  // namespace

Fit fit(const Pixels &pixels, const Picture &current, Point centre, const Warp &guess, const Settings &settings,
        Bench &bench, const Prior *prior) {
  Fit result;
  result.warp = guess;
  const Level f = level(pixels.grey.data(), pixels.mask.data(), pixels.padded, pixels.count);
  Curvature c;
  if (pixels.count > 8 && f.norm > 0) curvature(pixels, f, c);
  if (prior)
    for (int k = 0; k < 4; ++k) c.hessian[7 * (k + 2)] += prior->weight[k];
  if (!(pixels.count > 8 && f.norm > 0) || !reduced_inverse(c.hessian, settings.model, result.inverse.data())) {
    result.outcome = Outcome::NoContrast;
    return result;
  }
  result.grey = f.mean, result.contrast = f.norm * f.norm;
  std::copy_n(c.mean, 6, result.mean.begin()), std::copy_n(c.along, 6, result.along.begin());
  const double arm = settings.half / std::sqrt(3.0), wander = settings.wander * settings.wander;
  while (true) {
    if (!sample(current.spline(), pixels, centre, result.warp, bench)) {
      result.outcome = Outcome::Outside;
      return result;
    }
    const Level g = level(bench.sampled.data(), pixels.mask.data(), pixels.padded, pixels.count);
    if (!(g.norm > 1e-6 * f.norm)) {
      result.outcome = Outcome::NoContrast;
      return result;
    }
    double b[6], along, step[6];
    result.residual = score(pixels, f, g, bench, b, along);
    result.zncc = 1 - result.residual / (2 * f.norm * f.norm);
    result.gain = g.norm / f.norm, result.offset = g.mean - result.gain * f.mean;
    if (result.outcome == Outcome::Converged || result.iterations >= settings.max_iterations) return result;
    for (int k = 0; k < 6; ++k) b[k] -= c.along[k] * along;
    if (prior) {
      const double now[4] = {result.warp.ux, result.warp.uy, result.warp.vx, result.warp.vy};
      for (int k = 0; k < 4; ++k) b[k + 2] += prior->weight[k] * (prior->mean[k] - now[k]);
    }
    for (int k = 0; k < 6; ++k) {
      step[k] = 0;
      for (int l = 0; l < 6; ++l) step[k] += result.inverse[k * 6 + l] * b[l];
    }
    // e grows along J with the motion of the reference: the minimum lies at −step, which is composed inversely
    const Warp change{step[0], step[1], step[2], step[3], step[4], step[5]};
    Warp next = after_inverse(result.warp, {-change.u, -change.v, -change.ux, -change.uy, -change.vx, -change.vy});
    result.warp = settings.model == Model::Rigid ? as_rotation(next) : next;
    ++result.iterations;
    double size = step[0] * step[0] + step[1] * step[1];
    for (int k = 2; k < 6; ++k) size += arm * arm * step[k] * step[k];
    const double du = result.warp.u - guess.u, dv = result.warp.v - guess.v;
    if (!(du * du + dv * dv < wander)) {
      result.outcome = Outcome::Lost;
      return result;
    }
    if (size < settings.tolerance * settings.tolerance) result.outcome = Outcome::Converged;
  }
}

double misfit(const Pixels &pixels, const Picture &current, Point centre, const Warp &warp, double gain, double offset,
              Bench &bench) {
  if (!sample(current.spline(), pixels, centre, warp, bench)) return -1;
  double sum = 0;
  for (int i = 0; i < pixels.padded; ++i) {
    const float e = pixels.mask[i] * (pixels.grey[i] - float((bench.sampled[i] - offset) / gain));
    bench.error[i] = e, sum += double(e) * e;
  }
  return sum;
}

}  // namespace dic
