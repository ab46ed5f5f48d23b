// The pixels of a subset, or of a part of it, and their match in another picture.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "picture.hpp"

namespace dic {

// x' = x + u + u_x ξ + u_y η (ξ, η: column and row from the centre), likewise v.
struct Warp {
  double u = 0, v = 0, ux = 0, uy = 0, vx = 0, vy = 0;
  // The same motion seen from a centre that lies (ξ, η) away.
  Warp at(double xi, double eta) const { return {u + ux * xi + uy * eta, v + vx * xi + vy * eta, ux, uy, vx, vy}; }
};
Warp after_inverse(const Warp &w, const Warp &step);  // w ∘ step⁻¹

// A straight line through a subset: n·(ξ, η) = offset with n = (cos angle, sin angle), offset ≥ 0;
// the centre lies on the near side, n·(ξ, η) < offset.
struct Line {
  double angle = 0, offset = 0;
};

enum class Model : int { Translation = 0, Rigid = 1, Affine = 2 };

struct Settings {
  int half = 12;
  Model model = Model::Affine;
  int max_iterations = 30;
  double tolerance = 1e-3;  // px, of the motion of a typical pixel of the subset
  double wander = 12;       // px, farther from the guess the search is lost
};

// Pixels in lanes; the rest of the last lane has mask 0 and gradient 0.
struct Pixels {
  int count = 0, padded = 0;
  std::vector<float> xi, eta, grey, dx, dy, mask;
  std::vector<std::uint8_t> blind, dark;  // see picture.hpp; empty where the picture has neither
  void resize(int n);
  void keep(const std::vector<float> &signed_distance, double margin, Pixels &kept) const;  // those below −margin
  void move(int from, int to);
  void shrink(int n);  // to the first n pixels
};

struct Point {
  double column, row;
};

// The square subset around a point. With `from`, the subset is taken where `from` carries it (a later picture
// serves as reference); with `line` pixels beyond the line are carried by `far` instead. False: outside the picture.
bool gather(const Picture &picture, Point centre, int half, const Warp *from, const Warp *far, const Line *line,
            Pixels &out);

enum class Outcome : int { Converged = 0, NotConverged = 1, Outside = 2, NoContrast = 3, Lost = 4, Saturated = 5 };

struct Fit {
  Warp warp;
  Outcome outcome = Outcome::NotConverged;
  int iterations = 0;
  double zncc = -1;
  double residual = 0;           // Σ e² in grey values of the reference
  double gain = 1, offset = 0;   // current ≈ gain × reference + offset
  std::array<double, 36> inverse{};  // inverse of the Hessian of Σ e² / 2, brightness and contrast projected out
  std::array<double, 6> mean{}, along{};  // Σ J / n and Σ J f̃ / |f̃|², what was projected out
  double grey = 0, contrast = 0;          // mean f and |f̃|² of the reference
};

// What is known of the gradients beforehand: mean, and weight = variance of e / variance of the gradient.
struct Prior {
  std::array<double, 4> mean{}, weight{};
};

// Scratch memory of one thread.
struct Bench {
  std::vector<float> sampled, error, tx, ty;
  std::vector<int> cell;
  void resize(int padded);
};

// Values of the picture where the warp carries the pixels; false where one lies outside.
bool sample(const Spline &spline, const Pixels &pixels, Point centre, const Warp &warp, Bench &bench);

// Inverse-compositional Gauss–Newton on ZNSSD (Baker & Matthews 2004; Pan, Li & Tong 2013); leaves e in bench.error.
Fit fit(const Pixels &pixels, const Picture &current, Point centre, const Warp &guess, const Settings &settings,
        Bench &bench, const Prior *prior = nullptr);

// e = reference − (current − offset)/gain at a warp that is not changed; Σ e², or a negative number outside.
double misfit(const Pixels &pixels, const Picture &current, Point centre, const Warp &warp, double gain, double offset,
              Bench &bench);

}  // namespace dic
