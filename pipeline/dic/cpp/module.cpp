// The door to Python: arrays in, arrays out; the interpreter is released while the core works.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

#include <algorithm>
#include <optional>
#include <stdexcept>

#include "pattern.hpp"
#include "parallel.hpp"
#include "propagate.hpp"
#include "split.hpp"
#include "triangles.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace dic;

namespace {

using Grey = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Doubles = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Ints = nb::ndarray<const int, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using IntList = nb::ndarray<const int, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

template <class T> nb::object array(std::size_t rows, std::size_t columns, T *&data) {
  data = new T[std::max<std::size_t>(rows * columns, 1)]();
  nb::capsule owner(data, [](void *p) noexcept { delete[] static_cast<T *>(p); });
  const std::size_t shape[2] = {rows, columns};
  return nb::cast(nb::ndarray<nb::numpy, T>(data, columns ? 2 : 1, shape, owner));
}

template <class T> nb::object list(std::size_t n, T *&data) {
  data = new T[std::max<std::size_t>(n, 1)]();
  nb::capsule owner(data, [](void *p) noexcept { delete[] static_cast<T *>(p); });
  const std::size_t shape[1] = {n};
  return nb::cast(nb::ndarray<nb::numpy, T>(data, 1, shape, owner));
}

void need(bool condition, const char *message) {
  if (!condition) throw std::invalid_argument(message);
}

std::vector<Warp> warps(const Doubles &rows) {
  need(rows.shape(1) == 6, "a warp has 6 numbers: u, v, u_x, u_y, v_x, v_y");
  std::vector<Warp> out(rows.shape(0));
  const double *p = rows.data();
  for (auto &w : out) w = {p[0], p[1], p[2], p[3], p[4], p[5]}, p += 6;
  return out;
}

std::vector<Point> points_of(const Doubles &rows) {
  need(rows.shape(1) == 2, "a point has 2 numbers: column, row");
  std::vector<Point> out(rows.shape(0));
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = {rows(i, 0), rows(i, 1)};
  return out;
}

void put(const Warp &w, double *out) {
  const double p[6] = {w.u, w.v, w.ux, w.uy, w.vx, w.vy};
  std::copy_n(p, 6, out);
}

nb::dict unpack(const std::vector<PointResult> &results) {
  const std::size_t n = results.size();
  double *warp, *zncc, *residual, *level, *covariance, *contrast, *score, *bend, *line;
  int *outcome, *iterations, *count;
  nb::dict out;
  out["warp"] = array<double>(n, 6, warp);
  out["zncc"] = list<double>(n, zncc);
  out["residual"] = list<double>(n, residual);
  out["level"] = array<double>(n, 2, level);
  out["covariance"] = array<double>(n, 3, covariance);
  out["contrast"] = list<double>(n, contrast);
  out["score"] = list<double>(n, score);
  out["bend"] = list<double>(n, bend);
  out["suspect"] = array<double>(n, 4, line);
  out["outcome"] = list<int>(n, outcome);
  out["iterations"] = list<int>(n, iterations);
  out["count"] = list<int>(n, count);
  for (std::size_t i = 0; i < n; ++i) {
    const PointResult &r = results[i];
    put(r.fit.warp, warp + 6 * i);
    zncc[i] = r.fit.zncc, residual[i] = r.fit.residual, contrast[i] = r.fit.contrast, score[i] = r.suspicion.score, bend[i] = r.bend;
    level[2 * i] = r.fit.gain, level[2 * i + 1] = r.fit.offset;
    covariance[3 * i] = r.fit.inverse[0], covariance[3 * i + 1] = r.fit.inverse[7];
    covariance[3 * i + 2] = r.fit.inverse[1];
    const double s[4] = {r.suspicion.line.angle, r.suspicion.line.offset, r.suspicion.jump_u, r.suspicion.jump_v};
    std::copy_n(s, 4, line + 4 * i);
    outcome[i] = r.reached ? int(r.fit.outcome) : -1;
    iterations[i] = r.fit.iterations, count[i] = r.count;
  }
  return out;
}

Settings settings(int half, int model, int max_iterations, double tolerance, double wander) {
  need(half >= 2 && half <= 200, "half the subset size must be 2 to 200 px");
  need(model >= 0 && model <= 2, "the model is 0 (translation), 1 (rigid) or 2 (affine)");
  return {half, static_cast<Model>(model), max_iterations, tolerance, wander};
}

nb::dict unpack(const std::vector<SplitResult> &results) {
  const std::size_t n = results.size();
  double *near, *far, *line, *cost, *near_fit, *far_fit, *near_covariance, *far_covariance;
  int *attempted, *matched, *count, *iterations;
  nb::dict out;
  out["near"] = array<double>(n, 6, near);
  out["far"] = array<double>(n, 6, far);
  out["line"] = array<double>(n, 2, line);
  out["cost"] = array<double>(n, 3, cost);            // single, parted, swapped
  out["near_fit"] = array<double>(n, 5, near_fit);    // zncc, residual, gain, offset, score
  out["far_fit"] = array<double>(n, 5, far_fit);
  out["near_covariance"] = array<double>(n, 36, near_covariance);
  out["far_covariance"] = array<double>(n, 36, far_covariance);
  out["attempted"] = list<int>(n, attempted);
  out["far_matched"] = list<int>(n, matched);
  out["count"] = array<int>(n, 2, count);
  out["iterations"] = list<int>(n, iterations);
  for (std::size_t i = 0; i < n; ++i) {
    const SplitResult &r = results[i];
    put(r.near.warp, near + 6 * i), put(r.far.warp, far + 6 * i);
    const double l[2] = {r.line.angle, r.line.offset}, c[3] = {r.single, r.parted, r.swapped};
    const double a[5] = {r.near.zncc, r.near.residual, r.near.gain, r.near.offset, r.near_second.score};
    const double b[5] = {r.far.zncc, r.far.residual, r.far.gain, r.far.offset, r.far_second.score};
    std::copy_n(l, 2, line + 2 * i), std::copy_n(c, 3, cost + 3 * i);
    std::copy_n(a, 5, near_fit + 5 * i), std::copy_n(b, 5, far_fit + 5 * i);
    std::copy_n(r.near.inverse.data(), 36, near_covariance + 36 * i);
    std::copy_n(r.far.inverse.data(), 36, far_covariance + 36 * i);
    attempted[i] = r.attempted, matched[i] = r.far_matched;
    count[2 * i] = r.near_count, count[2 * i + 1] = r.far_count, iterations[i] = r.near.iterations;
  }
  return out;
}

}  // namespace

NB_MODULE(_correlate, m) {
  nb::class_<Picture>(m, "Picture")
      .def("__init__",
           [](Picture *self, Grey grey) {
             need(grey.shape(0) >= 8 && grey.shape(1) >= 8, "a picture needs 8 rows and 8 columns");
             nb::gil_scoped_release release;
             new (self) Picture(grey.data(), int(grey.shape(0)), int(grey.shape(1)));
           })
      .def_prop_ro("shape", [](const Picture &p) { return nb::make_tuple(p.rows(), p.columns()); });

  nb::class_<Pattern>(m, "Pattern")
      .def("__init__",
           [](Pattern *self, Doubles blobs) {
             need(blobs.shape(1) == 4, "a blob has 4 numbers: column, row, sigma, grey");
             std::vector<Blob> rows(blobs.shape(0));
             for (std::size_t i = 0; i < rows.size(); ++i)
               rows[i] = {blobs(i, 0), blobs(i, 1), blobs(i, 2), blobs(i, 3)};
             new (self) Pattern(std::move(rows));
           })
      .def("evaluate",
           [](const Pattern &self, Doubles points, int threads) {
             need(points.shape(1) == 2, "a point has 2 numbers: column, row");
             float *grey;
             nb::object out = list<float>(points.shape(0), grey);
             {
               nb::gil_scoped_release release;
               self.evaluate(points.data(), points.shape(0), grey, threads);
             }
             return out;
           },
           "points"_a, "threads"_a = 1);

  m.def(
      "propagate",
      [](const Picture &reference, const Picture &current, Doubles points, Ints neighbours, IntList seeds,
         Doubles guesses, std::optional<Doubles> from, int half, int model, int max_iterations, double tolerance,
         double wander, double accept, int threads) {
        need(neighbours.shape(0) == points.shape(0) && neighbours.shape(1) == 8, "neighbours are points × 8");
        need(seeds.shape(0) == guesses.shape(0), "one guess a seed");
        const std::vector<Warp> carried = from ? warps(*from) : std::vector<Warp>{};
        need(!from || carried.size() == points.shape(0), "one carried warp a point");
        const Task task{&reference, &current, points_of(points), neighbours.data(), from ? carried.data() : nullptr,
                        settings(half, model, max_iterations, tolerance, wander), accept, threads};
        const std::vector<int> start(seeds.data(), seeds.data() + seeds.shape(0));
        const std::vector<Warp> guess = warps(guesses);
        std::vector<PointResult> results;
        {
          nb::gil_scoped_release release;
          results = propagate(task, start, guess);
        }
        return unpack(results);
      },
      "reference"_a, "current"_a, "points"_a, "neighbours"_a, "seeds"_a, "guesses"_a, "carried"_a.none(), nb::kw_only(),
      "half"_a, "model"_a, "max_iterations"_a, "tolerance"_a, "wander"_a, "accept"_a, "threads"_a);

  m.def(
      "match",
      [](const Picture &reference, const Picture &current, Doubles points, Doubles guesses,
         std::optional<Doubles> from, int half, int model, int max_iterations, double tolerance, double wander,
         double accept, int threads) {
        need(guesses.shape(0) == points.shape(0), "one guess a point");
        const std::vector<Warp> carried = from ? warps(*from) : std::vector<Warp>{};
        need(!from || carried.size() == points.shape(0), "one carried warp a point");
        const Task task{&reference, &current, points_of(points), nullptr, from ? carried.data() : nullptr,
                        settings(half, model, max_iterations, tolerance, wander), accept, threads};
        const std::vector<Warp> guess = warps(guesses);
        std::vector<PointResult> results;
        {
          nb::gil_scoped_release release;
          results = match(task, guess.data());
        }
        return unpack(results);
      },
      "reference"_a, "current"_a, "points"_a, "guesses"_a, "carried"_a.none(), nb::kw_only(), "half"_a, "model"_a,
      "max_iterations"_a, "tolerance"_a, "wander"_a, "accept"_a, "threads"_a);

  // Candidates of all points one after the other, rows of u, v, u_x, u_y, v_x, v_y, gain, offset, ξ, η (where it
  // was seen, NaN: the point's own); those of point i are the rows first[i] to first[i + 1].
  m.def(
      "split",
      [](const Picture &reference, const Picture &current, Doubles points, Doubles candidates, IntList first,
         double variance, std::optional<Doubles> from, std::optional<Doubles> far, std::optional<Doubles> lines,
         int half, int model, int max_iterations, double tolerance, double wander, int threads) {
        const std::size_t n = points.shape(0);
        need(first.shape(0) == n + 1 && candidates.shape(1) == 10, "candidates are rows of 10 numbers, points + 1 starts");
        for (std::size_t i = 0; i < n; ++i)
          need(first(i) >= 0 && first(i) <= first(i + 1) && first(i + 1) <= int(candidates.shape(0)),
               "the starts of the candidates must not decrease");
        for (std::size_t i = 0; i < n; ++i)
          need(first(i + 1) - first(i) <= int(kMostCandidates), "a point has at most 15 candidates");
        const std::vector<Point> centre = points_of(points);
        const std::vector<Warp> near = from ? warps(*from) : std::vector<Warp>{}, beyond = far ? warps(*far) : near;
        need(near.empty() || (near.size() == n && beyond.size() == n), "one carried warp a point");
        need(!lines || (lines->shape(0) == n && lines->shape(1) == 2), "a line has an angle and an offset");
        SplitSettings s;
        s.fit = settings(half, model, max_iterations, tolerance, wander);
        std::vector<SplitResult> results(n);
        std::vector<SplitBench> work(std::max(threads, 1));
        {
          nb::gil_scoped_release release;
          parallel_for(int(n), threads, [&](int i, int w) {
            std::vector<Candidate> own;
            for (int k = first(i); k < first(i + 1); ++k) {
              const double *c = &candidates(k, 0);
              own.push_back({{c[0], c[1], c[2], c[3], c[4], c[5]}, c[6], c[7], c[8], c[9]});
            }
            const Line line = lines ? Line{(*lines)(i, 0), (*lines)(i, 1)} : Line{};
            const bool parted = lines && line.offset >= 0;
            results[i] = split(reference, current, centre[i], own, variance, s, near.empty() ? nullptr : &near[i],
                               parted && !beyond.empty() ? &beyond[i] : nullptr, parted ? &line : nullptr, work[w]);
          });
        }
        return unpack(results);
      },
      "reference"_a, "current"_a, "points"_a, "candidates"_a, "first"_a, "variance"_a, "carried"_a.none(),
      "far_carried"_a.none(), "lines"_a.none(), nb::kw_only(), "half"_a, "model"_a, "max_iterations"_a, "tolerance"_a,
      "wander"_a, "threads"_a);

  m.def(
      "cover",
      [](Doubles corners, Ints triangles, double column0, double row0, double step, int columns, int rows) {
        need(corners.shape(1) == 2 && triangles.shape(1) == 3, "corners are pairs, triangles are triples");
        need(columns > 0 && rows > 0 && step > 0, "a raster has columns, rows and a positive step");
        for (std::size_t i = 0; i < triangles.shape(0); ++i)
          for (int k = 0; k < 3; ++k)
            need(triangles(i, k) >= 0 && triangles(i, k) < int(corners.shape(0)), "a triangle names a missing corner");
        int *number;
        nb::object out = array<int>(rows, columns, number);
        {
          nb::gil_scoped_release release;
          cover(corners.data(), triangles.data(), triangles.shape(0), {column0, row0, step, columns, rows}, number);
        }
        return out;
      },
      "corners"_a, "triangles"_a, nb::kw_only(), "column0"_a, "row0"_a, "step"_a, "columns"_a, "rows"_a);
}
