// The C interface of the core: what is given is checked here, and no exception crosses the border.
#include "interface.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <new>
#include <stdexcept>

#include "parallel.hpp"
#include "pattern.hpp"
#include "propagate.hpp"
#include "split.hpp"
#include "triangles.hpp"

struct dic_picture {
  dic::Picture picture;
};

struct dic_pattern {
  dic::Pattern pattern;
};

using namespace dic;

namespace {

constexpr std::int64_t kMostPoints = 1 << 27;  // eight neighbours of each are counted in 32 bits
constexpr std::int64_t kLargest = 1 << 30;     // rows, columns; no picture comes near

void need(bool condition, const char *message) {
  if (!condition) throw std::invalid_argument(message);
}

dic_outcome say(char *text, dic_outcome outcome, const char *sentence) {
  std::snprintf(text, DIC_TEXT, "%s", sentence);
  return outcome;
}

template <class Work> std::int32_t guarded(char *text, const Work &work) noexcept {
  try {
    work();
    return DIC_DONE;
  } catch (const std::invalid_argument &refusal) {
    return say(text, DIC_REFUSED, refusal.what());
  } catch (const std::bad_alloc &) {
    return say(text, DIC_NO_MEMORY, "the image correlation needs more memory than there is");
  } catch (const std::length_error &) {
    return say(text, DIC_NO_MEMORY, "the image correlation needs more memory than can be addressed");
  } catch (const std::exception &error) {
    return say(text, DIC_FAILED, error.what());
  } catch (...) {
    return say(text, DIC_FAILED, "the image correlation failed");
  }
}

Warp warp_of(const double *p) { return {p[0], p[1], p[2], p[3], p[4], p[5]}; }

std::vector<Warp> warps(const double *rows, std::int64_t count) {
  std::vector<Warp> out(rows ? count : 0);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = warp_of(rows + 6 * i);
  return out;
}

std::vector<Point> points_of(const double *rows, std::int64_t count) {
  need(count >= 0 && count < kMostPoints, "the number of points must be below 134217728");
  std::vector<Point> out(count);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = {rows[2 * i], rows[2 * i + 1]};
  return out;
}

void put(const Warp &w, double *out) {
  const double p[6] = {w.u, w.v, w.ux, w.uy, w.vx, w.vy};
  std::copy_n(p, 6, out);
}

Settings checked(const dic_settings &s) {
  need(s.half >= 2 && s.half <= 200, "half the subset size must be 2 to 200 px");
  need(s.model >= 0 && s.model <= 2, "the model is 0 (translation), 1 (rigid) or 2 (affine)");
  return {s.half, static_cast<Model>(s.model), s.max_iterations, s.tolerance, s.wander};
}

// No more threads than parallel_for() would use: each of them has scratch memory.
int threads_for(std::int32_t asked, std::size_t count) { return std::max(1, std::min(asked, int(count / 4) + 1)); }

void unpack(const std::vector<PointResult> &results, dic_matched *out) {
  for (const PointResult &r : results) {
    put(r.fit.warp, out->warp);
    out->zncc = r.fit.zncc, out->residual = r.fit.residual, out->contrast = r.fit.contrast;
    out->level[0] = r.fit.gain, out->level[1] = r.fit.offset;
    out->covariance[0] = r.fit.inverse[0], out->covariance[1] = r.fit.inverse[7], out->covariance[2] = r.fit.inverse[1];
    out->score = r.suspicion.score, out->bend = r.bend;
    const double s[4] = {r.suspicion.line.angle, r.suspicion.line.offset, r.suspicion.jump_u, r.suspicion.jump_v};
    std::copy_n(s, 4, out->suspect);
    out->outcome = r.reached ? int(r.fit.outcome) : -1;
    out->iterations = r.fit.iterations, out->count = r.count;
    ++out;
  }
}

void unpack(const Fit &fit, double score, double *warp, double *numbers, double *covariance) {
  put(fit.warp, warp);
  const double n[5] = {fit.zncc, fit.residual, fit.gain, fit.offset, score};
  std::copy_n(n, 5, numbers);
  std::copy_n(fit.inverse.data(), 36, covariance);
}

void unpack(const SplitResult &r, dic_parted &out) {
  unpack(r.near, r.near_second.score, out.near, out.near_fit, out.near_covariance);
  unpack(r.far, r.far_second.score, out.far, out.far_fit, out.far_covariance);
  out.line[0] = r.line.angle, out.line[1] = r.line.offset, out.margin = r.margin;
  out.cost[0] = r.single, out.cost[1] = r.parted, out.cost[2] = r.swapped;
  out.attempted = r.attempted, out.far_matched = r.far_matched;
  out.count[0] = r.near_count, out.count[1] = r.far_count, out.iterations = r.near.iterations;
}

void need_starts(const std::int32_t *first, std::int64_t count, std::int64_t candidates) {
  need(first[0] >= 0 && first[count] <= candidates, "the starts of the candidates must lie among them");
  for (std::int64_t i = 0; i < count; ++i) {
    need(first[i] <= first[i + 1], "the starts of the candidates must not decrease");
    need(first[i + 1] - first[i] <= int(kMostCandidates), "a point has at most 15 candidates");
  }
}

std::vector<Candidate> candidates_of(const double *rows, std::int32_t begin, std::int32_t end) {
  std::vector<Candidate> out;
  for (const double *c = rows + 10 * std::size_t(begin); c < rows + 10 * std::size_t(end); c += 10)
    out.push_back({warp_of(c), c[6], c[7], c[8], c[9]});
  return out;
}

}  // namespace

int32_t dic_interface(void) { return DIC_INTERFACE; }

int32_t dic_new_picture(const float *grey, int64_t rows, int64_t columns, float floor, float ceiling,
                        dic_picture **made, char *text) {
  return guarded(text, [&] {
    need(rows >= 8 && columns >= 8, "a picture needs 8 rows and 8 columns");
    need(rows < kLargest && columns < kLargest, "a picture has fewer than 1073741824 rows and columns");
    *made = new dic_picture{Picture(grey, int(rows), int(columns), floor, ceiling)};
  });
}

void dic_free_picture(dic_picture *picture) { delete picture; }

int32_t dic_new_pattern(const double *blobs, int64_t count, dic_pattern **made, char *text) {
  return guarded(text, [&] {
    std::vector<Blob> rows(count);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double *b = blobs + 4 * i;
      need(std::isfinite(b[0] + b[1] + b[2] + b[3]) && b[2] > 0, "a blob needs finite numbers and a positive sigma");
      rows[i] = {b[0], b[1], b[2], b[3]};
    }
    *made = new dic_pattern{Pattern(std::move(rows))};
  });
}

void dic_free_pattern(dic_pattern *pattern) { delete pattern; }

int32_t dic_evaluate(const dic_pattern *pattern, const double *points, int64_t count, int32_t threads, float *grey,
                     char *text) {
  return guarded(text, [&] { pattern->pattern.evaluate(points, count, grey, threads); });
}

int32_t dic_propagate(const dic_picture *reference, const dic_picture *current, const double *points, int64_t count,
                      const int32_t *neighbours, const int32_t *seeds, const double *guesses, int64_t seed_count,
                      const double *carried, const dic_settings *settings, dic_matched *found, char *text) {
  return guarded(text, [&] {
    const std::vector<Warp> from = warps(carried, count);
    const Task task{&reference->picture, &current->picture, points_of(points, count), neighbours,
                    carried ? from.data() : nullptr, checked(*settings), settings->accept,
                    threads_for(settings->threads, count)};
    for (std::int64_t i = 0; i < 8 * count; ++i)
      need(neighbours[i] >= -1 && neighbours[i] < count, "a point names a missing neighbour");
    for (std::int64_t i = 0; i < seed_count; ++i)
      need(seeds[i] >= 0 && seeds[i] < count, "a seed names a missing point");
    unpack(propagate(task, {seeds, seeds + seed_count}, warps(guesses, seed_count)), found);
  });
}

int32_t dic_match(const dic_picture *reference, const dic_picture *current, const double *points, int64_t count,
                  const double *guesses, const double *carried, const dic_settings *settings, dic_matched *found,
                  char *text) {
  return guarded(text, [&] {
    const std::vector<Warp> from = warps(carried, count), guess = warps(guesses, count);
    const Task task{&reference->picture, &current->picture, points_of(points, count), nullptr,
                    carried ? from.data() : nullptr, checked(*settings), settings->accept,
                    threads_for(settings->threads, count)};
    unpack(match(task, guess.data()), found);
  });
}

int32_t dic_split(const dic_picture *reference, const dic_picture *current, const double *points, int64_t count,
                  const double *candidates, int64_t candidate_count, const int32_t *first, double variance,
                  const double *carried, const double *far_carried, const double *lines, const dic_settings *settings,
                  dic_parted *found, char *text) {
  return guarded(text, [&] {
    const std::vector<Point> centre = points_of(points, count);
    need_starts(first, count, candidate_count);
    const std::vector<Warp> near = warps(carried, count), beyond = far_carried ? warps(far_carried, count) : near;
    SplitSettings s;
    s.fit = checked(*settings);
    const int threads = threads_for(settings->threads, count);
    std::vector<SplitBench> work(threads);
    parallel_for(int(count), threads, [&](int i, int w) {
      const Line line = lines ? Line{lines[2 * i], lines[2 * i + 1]} : Line{};
      const bool parted = lines && line.offset >= 0;
      const SplitResult r = split(reference->picture, current->picture, centre[i],
                                  candidates_of(candidates, first[i], first[i + 1]), variance, s,
                                  near.empty() ? nullptr : &near[i], parted && !beyond.empty() ? &beyond[i] : nullptr,
                                  parted ? &line : nullptr, work[w]);
      unpack(r, found[i]);
    });
  });
}

int32_t dic_cover(const double *corners, int64_t corner_count, const int32_t *triangles, int64_t count, double column0,
                  double row0, double step, int32_t columns, int32_t rows, int32_t *number, char *text) {
  return guarded(text, [&] {
    need(columns > 0 && rows > 0 && step > 0, "a raster has columns, rows and a positive step");
    for (std::int64_t i = 0; i < 3 * count; ++i)
      need(triangles[i] >= 0 && triangles[i] < corner_count, "a triangle names a missing corner");
    cover(corners, triangles, count, {column0, row0, step, columns, rows}, number);
  });
}
