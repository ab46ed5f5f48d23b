// The numbers of a factorisation in one precision: front by front, a dense Cholesky factor of the columns that are
// eliminated there; what is left of the further rows goes to the parent (Duff & Reid 1983; Liu 1992).
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>

#include "blas.hpp"
#include "lanes.hpp"
#include "plan.hpp"

struct CholeskyFactor {
  int64_t raised = 0;  // pivots

  virtual ~CholeskyFactor() = default;
  virtual void solve(double *side, int64_t count) const = 0;
  virtual void last(int64_t count, double *last) const = 0;
};

namespace cholesky {

template <typename T>
class Factor : public CholeskyFactor {
 public:
  Factor(const Plan &plan, const Blas<T> &blas, const double *value, double smallest)
      : plan_(plan), blas_(blas), panels_(new T[plan.panels]()) {
    std::unique_ptr<T[]> rests(new T[plan.rests]), least(new T[plan.size]);
    for (int64_t j = 0; j < plan.size; ++j) least[j] = static_cast<T>(smallest * value[plan.diagonal[j]]);
    for (const Front &front : plan.front) {
      for (int64_t k = front.entries; k < front.last; ++k)
        panels_[plan.target[k]] += static_cast<T>(value[plan.source[k]]);
      T *rest = rests.get() + front.rest;
      std::fill(rest, rest + front.square(), T(0));
      for (const int32_t child : front.children) take_in(front, plan.front[child], rests.get(), rest);
      eliminate(front, rest, least.get() + front.first);
    }
  }

  void solve(double *side, int64_t count) const override {
    const std::unique_ptr<T[]> memory(new T[count * (plan_.size + plan_.highest)]);
    T *x = memory.get(), *part = x + count * plan_.size;
    for (int64_t i = 0; i < plan_.size; ++i)
      for (int64_t k = 0; k < count; ++k) x[i * count + k] = static_cast<T>(side[plan_.order[i] * count + k]);
    for (const Front &front : plan_.front) {
      if (count == 1)
        forward(front, x, part);
      else
        forward(front, x, part, static_cast<int>(count));
    }
    for (auto front = plan_.front.rbegin(); front != plan_.front.rend(); ++front) {
      if (count == 1)
        backward(*front, x, part);
      else
        backward(*front, x, part, static_cast<int>(count));
    }
    for (int64_t i = 0; i < plan_.size; ++i)
      for (int64_t k = 0; k < count; ++k) side[plan_.order[i] * count + k] = x[i * count + k];
  }

  void last(int64_t count, double *last) const override {
    const int64_t skipped = plan_.size - count;
    std::fill(last, last + count * count, 0.0);
    for (const Front &front : plan_.front)
      for (int32_t j = 0; j < front.columns; ++j) {
        const int64_t into = plan_.order[front.first + j] - skipped;
        if (into < 0) continue;
        const T *column = panel(front) + static_cast<int64_t>(j) * front.height();
        const auto put = [&](int32_t i, T number) {
          const int64_t row = plan_.order[i] - skipped;
          if (row >= 0) last[row * count + into] = number;  // others are zeros that were stored for one front less
        };
        for (int32_t i = j; i < front.columns; ++i) put(front.first + i, column[i]);
        for (int32_t i = 0; i < front.below; ++i) put(rows(front)[i], column[front.top() + i]);
      }
  }

 private:
  static constexpr int kBlock = 32;      // columns factorised at a time
  static constexpr int kAhead = 1 << 14;  // bytes between what is used and what is fetched

  const Plan &plan_;
  const Blas<T> &blas_;
  std::unique_ptr<T[]> panels_;

  T *panel(const Front &front) const { return panels_.get() + front.panel; }
  T *corner(const Front &front, int first) const {
    return panel(front) + static_cast<int64_t>(front.height()) * front.columns + first * kLanes;
  }
  const int32_t *rows(const Front &front) const { return plan_.row.data() + front.rows; }

  // Adds what a child left, lower half, to a front.
  void take_in(const Front &front, const Front &child, const T *rests, T *rest) const {
    const int32_t *place = plan_.place.data() + child.rows;
    const T *left = rests + child.rest;
    for (int j = 0; j < child.below; ++j, left += child.below) {
      const int64_t column = place[j];
      T *into = column < front.columns ? panel(front) + column * front.height()
                                       : rest + (column - front.top()) * front.below - front.top();
      for (int i = j; i < child.below; ++i) into[place[i]] += left[i];
    }
  }

  // Eliminates the columns of a front; what is left goes to `rest`.
  void eliminate(const Front &front, T *rest, const T *least) {
    const int height = front.height();
    const int64_t step = height;
    for (int first = 0; first < front.columns; first += kBlock) {
      const int width = std::min(kBlock, front.columns - first), end = first + width;
      T *corner = panel(front) + first * step + first;
      factorise_block(corner, width, height, least + first);
      if (height > end) blas_.divide("T", height - end, width, corner, height, corner + width, height);
      for (int next = end; next < front.columns; next += kBlock) {
        const T *left = corner + next - first;
        T *into = panel(front) + next * step + next;
        const int columns = std::min(kBlock, front.columns - next);
        blas_.subtract("T", height - next, columns, width, left, height, left, height, 1, into, height);
      }
    }
    if (front.below)
      blas_.subtract_square(front.below, front.columns, panel(front) + front.top(), height, rest, front.below);
    for (int first = 0; first < front.columns; first += kLanes)
      invert(panel(front) + first * step + first, std::min(kLanes, front.columns - first), height,
             corner(front, first));
  }

  // The inverse of a lower triangle (n, n), column by column, among zeros.
  static void invert(const T *lower, int n, int64_t height, T *inverse) {
    for (int j = 0; j < n; ++j) {
      T *x = inverse + j * kLanes;
      x[j] = 1;
      for (int k = j; k < n; ++k) {
        const T *column = lower + k * height;
        x[k] /= column[k];
        for (int i = k + 1; i < n; ++i) x[i] -= column[i] * x[k];
      }
    }
  }

  // The Cholesky factor (n, n) in the lower half of a block; too small pivots are raised to `least` (n,).
  void factorise_block(T *block, int n, int height, const T *least) {
    for (int j = 0; j < n; ++j) {
      T *column = block + static_cast<int64_t>(j) * height;
      if (!(column[j] >= least[j])) {
        column[j] = least[j];
        ++raised;
      }
      column[j] = std::sqrt(column[j]);
      const T inverse = 1 / column[j];
      for (int i = j + 1; i < n; ++i) column[i] *= inverse;
      for (int k = j + 1; k < n; ++k) {
        T *other = block + static_cast<int64_t>(k) * height;
        const T share = column[k];
        for (int i = k; i < n; ++i) other[i] -= share * column[i];
      }
    }
  }

  // One right-hand side x: L⁻¹ x within a front, and what that takes from the rows below.
  void forward(const Front &front, T *x, T *part) const {
    T *own = x + front.first, *below = part + front.top();
    std::fill(std::copy(own, own + front.columns, part), part + front.height(), T(0));
    for (int first = 0; first < front.columns; first += kLanes) {
      const Columns block = columns(front, first);
      const Lanes<T> right = lanes(part + first);
      Lanes<T> found = {};
      for (int k = 0; k < kLanes; ++k) found += lanes(block.corner + k * kLanes) * right[k];
      lanes(part + first) = found;
      for (int i = first + kLanes; i < front.height(); i += kLanes) {
        fetch(block.column[0] + (i - first) * kLanes, kAhead);
        Lanes<T> left = lanes(part + i);
        for (int k = 0; k < kLanes; ++k) left -= lanes(block.column[k] + i) * found[k];
        lanes(part + i) = left;
      }
    }
    std::copy(part, part + front.columns, own);
    const int32_t *row = rows(front);
    for (int i = 0; i < front.below; ++i) x[row[i]] += below[i];
  }

  void backward(const Front &front, T *x, T *part) const {
    T *own = x + front.first, *below = part + front.top();
    const int32_t *row = rows(front);
    std::fill(std::copy(own, own + front.columns, part), part + front.height(), T(0));
    for (int i = 0; i < front.below; ++i) below[i] = x[row[i]];
    for (int first = front.top() - kLanes; first >= 0; first -= kLanes) {
      const Columns block = columns(front, first);
      Lanes<T> share[kLanes] = {};
      for (int i = first + kLanes; i < front.height(); i += kLanes) {
        fetch(block.column[0] + (i - first) * kLanes, -kAhead);
        const Lanes<T> right = lanes(part + i);
        for (int k = 0; k < kLanes; ++k) share[k] += lanes(block.column[k] + i) * right;
      }
      const Lanes<T> left = lanes(part + first) - sums<T>(share);
      for (int k = 0; k < kLanes; ++k) share[k] = lanes(block.corner + k * kLanes) * left;
      lanes(part + first) = sums<T>(share);
    }
    std::copy(part, part + front.columns, own);
  }

  // Has the numbers read that will be needed soon: panels lie behind one another in the order of elimination, but each
  // is read in several short columns, in which the processor sees no order.
  static void fetch(const T *at, int bytes) {
    const char *from = reinterpret_cast<const char *>(at) + bytes;
    for (size_t k = 0; k < kLanes * kLanes * sizeof(T); k += 64) __builtin_prefetch(from + k);
  }

  // Neighbouring columns of a front and the inverse of their diagonal block; where there are fewer, the last stands in
  // for the others and the inverse is zero there.
  struct Columns {
    const T *column[kLanes], *corner;
  };

  Columns columns(const Front &front, int first) const {
    Columns block;
    for (int k = 0; k < kLanes; ++k)
      block.column[k] = panel(front) + static_cast<int64_t>(std::min(first + k, front.columns - 1)) * front.height();
    block.corner = corner(front, first);
    return block;
  }

  // The same for several, row by row.
  void forward(const Front &front, T *x, T *part, int count) const {
    const int64_t step = count;
    const int height = front.height();
    T *own = x + step * front.first;
    if (std::all_of(own, own + step * front.columns, [](T number) { return number == 0; })) return;  // often: few loads
    blas_.divide("T", count, front.columns, panel(front), height, own, count);
    if (!front.below) return;
    blas_.subtract("T", count, front.below, front.columns, own, count, panel(front) + front.top(), height, 0, part,
                   count);
    const int32_t *row = rows(front);
    for (int i = 0; i < front.below; ++i)
      for (int k = 0; k < count; ++k) x[step * row[i] + k] += part[step * i + k];
  }

  void backward(const Front &front, T *x, T *part, int count) const {
    const int64_t step = count;
    const int height = front.height();
    T *own = x + step * front.first;
    const int32_t *row = rows(front);
    for (int i = 0; i < front.below; ++i) std::copy(x + step * row[i], x + step * (row[i] + 1), part + step * i);
    if (front.below)
      blas_.subtract("N", count, front.columns, front.below, part, count, panel(front) + front.top(), height, 1, own,
                     count);
    blas_.divide("N", count, front.columns, panel(front), height, own, count);
  }
};

}  // namespace cholesky
