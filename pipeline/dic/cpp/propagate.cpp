#include "propagate.hpp"

#include <algorithm>
#include <cmath>

#include "parallel.hpp"
#include "seen.hpp"

namespace dic {
namespace {

constexpr double kAsk = 16;  // score from which it is worth knowing whether the field is bent
constexpr int kTries = 4;  // a point that failed is tried again when a better neighbour turns up

struct Worker {
  Pixels pixels;
  Bench bench;
};

PointResult solve(const Task &task, int i, const Warp &guess, Worker &worker) {
  PointResult r;
  r.reached = true;
  const Warp *from = task.from ? &task.from[i] : nullptr;
  if (!gather(*task.reference, task.points[i], task.settings.half, from, nullptr, nullptr, worker.pixels)) {
    r.fit.outcome = Outcome::Outside;
    return r;
  }
  r.fit = fit_seen(worker.pixels, *task.current, task.points[i], guess, task.settings, worker.bench);
  r.count = worker.pixels.count;
  if (r.fit.outcome != Outcome::Converged || r.fit.zncc <= task.accept) return r;
  const float *error = worker.bench.error.data();
  const int half = task.settings.half;
  r.suspicion = screen(worker.pixels, error, r.fit, r.fit.residual / std::max(r.count - 8, 1), half);
  if (r.suspicion.score > kAsk) r.bend = bend(worker.pixels, error, r.fit, half);
  return r;
}

bool good(const Task &task, const PointResult &r) {
  return r.reached && r.fit.outcome == Outcome::Converged && r.fit.zncc > task.accept;
}

}  // namespace

std::vector<PointResult> propagate(const Task &task, const std::vector<int> &seeds, const std::vector<Warp> &guesses) {
  const int n = int(task.points.size());
  std::vector<PointResult> result(n);
  std::vector<Worker> workers(std::max(task.threads, 1));
  std::vector<int> wave = seeds, tries(n, 0), source(n, -1);
  std::vector<Warp> guess(n);
  for (std::size_t k = 0; k < seeds.size(); ++k) guess[seeds[k]] = guesses[k];
  while (!wave.empty()) {
    parallel_for(int(wave.size()), task.threads,
                 [&](int k, int w) { result[wave[k]] = solve(task, wave[k], guess[wave[k]], workers[w]); });
    std::vector<int> next;
    for (int i : wave) {
      ++tries[i];
      if (!good(task, result[i])) continue;
      for (int k = 0; k < 8; ++k) {
        const int j = task.neighbours[8 * i + k];
        if (j < 0 || tries[j] >= kTries || good(task, result[j])) continue;
        if (source[j] >= 0 && result[source[j]].fit.zncc >= result[i].fit.zncc) continue;
        source[j] = i;
        next.push_back(j);
      }
    }
    std::sort(next.begin(), next.end());
    next.erase(std::unique(next.begin(), next.end()), next.end());
    for (int j : next) {
      const Point &a = task.points[source[j]], &b = task.points[j];
      guess[j] = result[source[j]].fit.warp.at(b.column - a.column, b.row - a.row);
    }
    wave.swap(next);
  }
  return result;
}

std::vector<PointResult> match(const Task &task, const Warp *guesses) {
  std::vector<PointResult> result(task.points.size());
  std::vector<Worker> workers(std::max(task.threads, 1));
  parallel_for(int(result.size()), task.threads,
               [&](int i, int w) { result[i] = solve(task, i, guesses[i], workers[w]); });
  return result;
}

}  // namespace dic
