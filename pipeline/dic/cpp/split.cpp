#include "split.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "lanes.hpp"
#include "seen.hpp"

namespace dic {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kLeastFar = 24;     // pixels; smaller parts are not matched
constexpr int kLeastAffine = 72;  // pixels; smaller far parts keep the gradients they were given
constexpr double kNone = 0.6;     // share of the clip that a pixel without a match costs
constexpr double kClean = 20;      // χ² of the score test that needs no wider margin
constexpr double kSurest = 1e-3;  // gradients are never taken for better known than this
constexpr double kInnermost = 0.5, kOutermost = 4.5;  // px, of the band along the line that may be left out

// Maps of clipped cost, the candidates of one pixel side by side in lanes; the last one stands for pixels that nothing
// matches.
struct Maps {
  int rows, pixels;
  std::vector<float> cost;
  Maps(int rows, int pixels) : rows(rows), pixels(pixels), cost(static_cast<std::size_t>(pixels) * kLanes) {}
  float &at(int k, int i) { return cost[static_cast<std::size_t>(i) * kLanes + k]; }
  float at(int k, int i) const { return cost[static_cast<std::size_t>(i) * kLanes + k]; }
  void fill(int k, float value) {
    for (int i = 0; i < pixels; ++i) at(k, i) = value;
  }
  double total(int k) const {
    double s = 0;
    for (int i = 0; i < pixels; ++i) s += at(k, i);
    return s;
  }
};

struct Cut {
  Line line;
  int near = -1, far = -1;
  double cost = std::numeric_limits<double>::max();
};

// The map of one candidate; a motion that leaves the picture matches nothing.
void fill_cost(const Pixels &p, const Picture &current, Point centre, const Candidate &c, double variance,
               const SplitSettings &settings, Bench &bench, Maps &maps, int k) {
  const float clip = float(settings.clip);
  if (misfit(p, current, centre, c.warp, c.gain, c.offset, bench) < 0) return maps.fill(k, clip);
  for (int i = 0; i < p.count; ++i)
    maps.at(k, i) = std::min(float(bench.error[i] * bench.error[i] / variance), clip);
  if (p.blind.empty() && !limited_about(current, centre, c.warp, settings.fit.half)) return;
  for (int i = 0; i < p.count; ++i)  // what cannot be seen speaks neither for nor against
    if (blind(p, i, current, centre, c.warp)) maps.at(k, i) = 1;
}

// Sums of every map over strips along the direction (nx, ny).
DIC_CLONES void sum_strips(const Pixels &p, const float *cost, float nx, float ny, float reach, float width,
                           float *strips) {
  const float scale = 1 / width;
  for (int i = 0; i < p.count; ++i) {
    const int s = int((nx * p.xi[i] + ny * p.eta[i] + reach) * scale);
    *lanes(strips + s * kLanes) += *lanes(cost + i * kLanes);
  }
}

// The cheapest line over `angles` half-turn steps and offsets `width` apart. Either side takes its own cheapest map,
// unless `near` and `far` are given.
Cut best_cut(const Pixels &p, const Maps &maps, int half, int angles, double width, int near, int far,
             std::vector<float> &strips) {
  const double reach = half * std::sqrt(2.0) + 1;
  const int count = int(2 * reach / width) + 1;
  Cut best;
  double below[kLanes], total[kLanes];
  for (int a = 0; a < angles; ++a) {
    const double angle = a * kPi / angles;
    strips.assign(static_cast<std::size_t>(count + 1) * kLanes, 0.0f);
    sum_strips(p, maps.cost.data(), float(std::cos(angle)), float(std::sin(angle)), float(reach), float(width),
               strips.data());
    std::fill_n(below, kLanes, 0.0), std::fill_n(total, kLanes, 0.0);
    for (int s = 0; s <= count; ++s)
      for (int k = 0; k < maps.rows; ++k) total[k] += strips[static_cast<std::size_t>(s) * kLanes + k];
    for (int s = 0; s + 1 < count; ++s) {
      int low = 0, high = 0;
      for (int k = 0; k < maps.rows; ++k) {
        below[k] += strips[static_cast<std::size_t>(s) * kLanes + k];
        if (below[k] < below[low]) low = k;
        if (total[k] - below[k] < total[high] - below[high]) high = k;
      }
      const double offset = (s + 1) * width - reach;
      if (near >= 0) low = offset >= 0 ? near : far, high = offset >= 0 ? far : near;
      const double cost = below[low] + total[high] - below[high];
      if (cost >= best.cost) continue;
      best.cost = cost;
      if (offset >= 0) best.line = {angle, offset}, best.near = low, best.far = high;
      if (offset < 0) best.line = {angle + kPi, -offset}, best.near = high, best.far = low;
    }
  }
  return best;
}

void distances(const Pixels &p, const Line &line, double sign, std::vector<float> &out) {
  const float nx = float(sign * std::cos(line.angle)), ny = float(sign * std::sin(line.angle));
  out.resize(p.count);
  for (int i = 0; i < p.count; ++i) out[i] = nx * p.xi[i] + ny * p.eta[i] - float(sign * line.offset);
}

// The band along the line that does not match its own side: the gap, its blur and what a bent line leaves over.
double band(const std::vector<float> &distance, const Maps &maps, int k, double expected) {
  constexpr int bins = int(kOutermost - kInnermost) + 1;
  double sum[bins] = {}, number[bins] = {};
  for (std::size_t i = 0; i < distance.size(); ++i) {
    const int bin = int(std::floor(-distance[i]));
    if (bin >= 0 && bin < bins) sum[bin] += maps.at(k, int(i)), number[bin] += 1;
  }
  double margin = kInnermost;
  for (int b = 0; b < bins; ++b)
    if (sum[b] > expected * (number[b] + 4 * std::sqrt(2 * number[b] + 1))) margin = b + 1.5;
  return std::min(margin, kOutermost);
}

// The gradients that the neighbours on one side of the line agree on, as far as they agree (empirical Bayes): half a
// subset knows little of the gradient across the line, and what it does not know it would pass on to the displacement.
bool agreed(const std::vector<Candidate> &candidates, const Line &line, double sign, double variance, Prior &prior) {
  double sum[4] = {}, square[4] = {};
  int n = 0;
  for (const Candidate &c : candidates) {
    const double d = c.xi * std::cos(line.angle) + c.eta * std::sin(line.angle) - line.offset;
    if (!(sign * d < -1)) continue;
    const double g[4] = {c.warp.ux, c.warp.uy, c.warp.vx, c.warp.vy};
    for (int k = 0; k < 4; ++k) sum[k] += g[k], square[k] += g[k] * g[k];
    ++n;
  }
  if (n < 3) return false;
  double scatter = 0;  // one for all four: they are few
  for (int k = 0; k < 4; ++k) {
    prior.mean[k] = sum[k] / n;
    scatter += (square[k] - n * prior.mean[k] * prior.mean[k]) / (4.0 * (n - 1));
  }
  prior.weight.fill(variance / std::max(scatter, kSurest * kSurest));
  return true;
}

struct Part {
  const Picture &current;
  Point centre;
  Settings settings;
  SplitBench &work;
};

// Match one side of the line; sign +1 the near one. False where it is too small or finds nothing.
bool match_side(const Part &part, const Line &line, double sign, double margin, const Candidate &start, Fit &out,
                int &count, const Prior *prior = nullptr) {
  SplitBench &w = part.work;
  distances(w.all, line, sign, w.distance);
  w.all.keep(w.distance, margin, w.part);
  count = w.part.count;
  if (count < kLeastFar) return false;
  Settings s = part.settings;
  if (count < kLeastAffine) s.model = Model::Translation;
  out = fit_seen(w.part, part.current, part.centre, start.warp, s, w.bench, prior);
  count = w.part.count;
  return out.outcome == Outcome::Converged && out.zncc > 0.3;
}

Candidate seen(const Fit &f) { return {f.warp, f.gain, f.offset}; }

// As match_side(), but while the score test finds the rim of the gap in the part the margin is widened.
bool match_clean(const Part &part, const Line &line, double sign, double margin, const Candidate &start, Fit &out,
                 int &count, const Prior *prior, Suspicion &second, double *used = nullptr) {
  for (int extra = 0; extra < 3; ++extra) {
    if (used) *used = margin + extra;
    if (!match_side(part, line, sign, margin + extra, start, out, count, prior)) return false;
    second = screen(part.work.part, part.work.bench.error.data(), out, out.residual / std::max(count - 8, 1),
                    part.settings.half);
    if (second.score < kClean) return true;
  }
  return true;
}

}  // namespace

SplitResult split(const Picture &reference, const Picture &current, Point centre,
                  const std::vector<Candidate> &candidates, double variance, const SplitSettings &settings,
                  const Warp *from, const Warp *far_from, const Line *known, SplitBench &work) {
  SplitResult r;
  const int half = settings.fit.half;
  if (candidates.empty() || candidates.size() > kMostCandidates || !gather(reference, centre, half, from, far_from, known, work.all)) return r;
  const int n = work.all.count;
  Maps maps(int(candidates.size()) + 1, n);
  r.single = std::numeric_limits<double>::max();
  for (int k = 0; k + 1 < maps.rows; ++k) {
    fill_cost(work.all, current, centre, candidates[k], variance, settings, work.bench, maps, k);
    r.single = std::min(r.single, maps.total(k));
  }
  const int none = maps.rows - 1;
  maps.fill(none, float(kNone * settings.clip));
  Cut cut = best_cut(work.all, maps, half, 24, 1.0, -1, -1, work.strips);
  if (cut.near == none || cut.near < 0) return r;
  Candidate near = candidates[cut.near], far = cut.far == none ? candidates[cut.near] : candidates[cut.far];
  Maps two(3, n);
  for (int k = 0; k < 3; ++k) two.fill(k, float(kNone * settings.clip));
  const Part part{current, centre, settings.fit, work};
  double near_margin = 1.5, far_margin = 1.5;
  bool far_known = cut.far != none;
  Prior near_prior, far_prior;
  for (int round = 0; round < settings.rounds; ++round) {
    const Line before = cut.line;
    const Prior *near_known = agreed(candidates, cut.line, 1, variance, near_prior) ? &near_prior : nullptr;
    const Prior *beyond = agreed(candidates, cut.line, -1, variance, far_prior) ? &far_prior : nullptr;
    if (!match_side(part, cut.line, 1, near_margin, near, r.near, r.near_count, near_known)) return r;
    near = seen(r.near);
    r.far_matched = far_known && match_side(part, cut.line, -1, far_margin, far, r.far, r.far_count, beyond);
    if (r.far_matched) far = seen(r.far);
    fill_cost(work.all, current, centre, near, variance, settings, work.bench, two, 0);
    if (far_known) fill_cost(work.all, current, centre, far, variance, settings, work.bench, two, 1);
    cut = best_cut(work.all, two, half, 48, 0.5, 0, far_known ? 1 : 2, work.strips);
    distances(work.all, cut.line, 1, work.distance);
    near_margin = band(work.distance, two, 0, 1.0);
    distances(work.all, cut.line, -1, work.distance);
    far_margin = band(work.distance, two, 1, 1.0);
    const double turn = std::abs(std::remainder(cut.line.angle - before.angle, 2 * kPi));
    if (round > 0 && turn < 0.08 && std::abs(cut.line.offset - before.offset) < 0.6) break;
  }
  r.attempted = true, r.line = cut.line, r.parted = cut.cost;
  if (far_known) r.swapped = best_cut(work.all, two, half, 48, 0.5, 1, 0, work.strips).cost;
  else r.swapped = std::numeric_limits<double>::max();
  const Prior *near_known = agreed(candidates, cut.line, 1, variance, near_prior) ? &near_prior : nullptr;
  const Prior *beyond = agreed(candidates, cut.line, -1, variance, far_prior) ? &far_prior : nullptr;
  if (far_known)
    r.far_matched = match_clean(part, cut.line, -1, far_margin, far, r.far, r.far_count, beyond, r.far_second);
  if (!match_clean(part, cut.line, 1, near_margin, near, r.near, r.near_count, near_known, r.near_second, &r.margin))
    r.attempted = false;
  return r;
}

}  // namespace dic
