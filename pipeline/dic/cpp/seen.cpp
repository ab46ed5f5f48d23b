#include "seen.hpp"

#include <algorithm>
#include <cmath>

namespace dic {

bool limited_about(const Picture &picture, Point centre, const Warp &w, int half) {
  const double stretch = 1 + std::max(std::abs(w.ux) + std::abs(w.uy), std::abs(w.vx) + std::abs(w.vy));
  return picture.limited(centre.column + w.u, centre.row + w.v, stretch * half + 1);
}

namespace {

constexpr double kLeastSeen = 0.5;     // share of the pixels that must not be blind
constexpr double kLeastBright = 0.25;  // share that must be neither blind nor dark, where there are both
constexpr double kMostMore = 0.25;     // share by which one picture may have more blind pixels: the light was another
constexpr double kMostDark = 0.4;      // share of the pixels that may be dark in one picture and not in the other

struct Place {
  double column, row;
  bool inside;
};

Place carried(const Pixels &p, int i, Point centre, const Warp &w, const Picture &current) {
  const double c = centre.column + p.xi[i] + w.u + w.ux * p.xi[i] + w.uy * p.eta[i];
  const double r = centre.row + p.eta[i] + w.v + w.vx * p.xi[i] + w.vy * p.eta[i];
  return {c, r, current.spline().contains(c, r)};
}

// Take out blind pixels; true where there were any.
bool hide(Pixels &p, const Picture &current, Point centre, const Warp &w) {
  int k = 0;
  for (int i = 0; i < p.count; ++i)
    if (!blind(p, i, current, centre, w)) p.move(i, k++);
  if (k == p.count) return false;
  p.shrink(k);
  return true;
}

// By how many pixels one of the pictures is blinder.
int blinder(const Pixels &p, const Picture &current, Point centre, const Warp &w) {
  int more = 0;
  for (int i = 0; i < p.count; ++i) {
    const Place at = carried(p, i, centre, w, current);
    more += (at.inside && current.blind(at.column, at.row)) - (!p.blind.empty() && p.blind[i]);
  }
  return std::abs(more);
}

bool darkened(const Pixels &p, const Picture &current, Point centre, const Warp &w) {
  int differ = 0;
  for (int i = 0; i < p.count; ++i) {
    const Place at = carried(p, i, centre, w, current);
    differ += at.inside && current.dark(at.column, at.row) != (!p.dark.empty() && p.dark[i]);
  }
  return differ > kMostDark * p.count;
}

}  // namespace

bool blind(const Pixels &p, int i, const Picture &current, Point centre, const Warp &w) {
  if (!p.blind.empty() && p.blind[i]) return true;
  const Place at = carried(p, i, centre, w, current);
  return at.inside && current.blind(at.column, at.row);
}

Fit fit_seen(Pixels &pixels, const Picture &current, Point centre, const Warp &guess, const Settings &settings,
             Bench &bench, const Prior *prior) {
  constexpr int kRounds = 3;  // what is blind depends on the warp
  const auto limited = [&](const Warp &w) { return limited_about(current, centre, w, settings.half); };
  if (pixels.blind.empty() && !limited(guess)) {
    const Fit plain = fit(pixels, current, centre, guess, settings, bench, prior);
    if (plain.outcome != Outcome::Converged || !limited(plain.warp)) return plain;
  }
  const int all = pixels.count, more = blinder(pixels, current, centre, guess);
  hide(pixels, current, centre, guess);
  Fit result = fit(pixels, current, centre, guess, settings, bench, prior);
  for (int round = 0; round < kRounds && result.outcome == Outcome::Converged; ++round) {
    if (!hide(pixels, current, centre, result.warp)) break;
    result = fit(pixels, current, centre, result.warp, settings, bench, prior);
  }
  const int bright = pixels.count - int(std::count(pixels.dark.begin(), pixels.dark.end(), 1));
  if (pixels.count < kLeastSeen * all || more > kMostMore * all ||
      (pixels.count < all && bright < kLeastBright * all) || darkened(pixels, current, centre, result.warp))
    result.outcome = Outcome::Saturated;
  return result;
}

}  // namespace dic
