// The numbers of a factorisation in one precision: front by front, a dense Cholesky factor of the columns that are
// eliminated there; what is left of the further rows goes to the parent (Duff & Reid 1983; Liu 1992).
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>

#include "blas.hpp"
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
    std::copy(side, side + count * plan_.size, x);
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
    std::copy(x, x + count * plan_.size, side);
  }

  void last(int64_t count, double *last) const override {
    const int64_t skipped = plan_.size - count;
    std::fill(last, last + count * count, 0.0);
    for (const Front &front : plan_.front)
      for (int64_t j = std::max<int64_t>(0, skipped - front.first); j < front.columns; ++j) {
        const T *column = panel(front) + j * front.height();
        double *into = last + (front.first + j - skipped);
        for (int64_t i = j; i < front.columns; ++i) into[(front.first + i - skipped) * count] = column[i];
        for (int64_t i = 0; i < front.below; ++i) into[(rows(front)[i] - skipped) * count] = column[front.columns + i];
      }
  }

 private:
  static constexpr int kBlock = 32;  // columns factorised at a time
  static constexpr int kLanes = 64 / sizeof(T);

  const Plan &plan_;
  const Blas<T> &blas_;
  std::unique_ptr<T[]> panels_;

  T *panel(const Front &front) const { return panels_.get() + front.panel; }
  const int32_t *rows(const Front &front) const { return plan_.row.data() + front.rows; }

  // Adds what a child left, lower half, to a front.
  void take_in(const Front &front, const Front &child, const T *rests, T *rest) const {
    const int32_t *place = plan_.place.data() + child.rows;
    const T *left = rests + child.rest;
    for (int j = 0; j < child.below; ++j, left += child.below) {
      const int64_t column = place[j];
      T *into = column < front.columns ? panel(front) + column * front.height()
                                       : rest + (column - front.columns) * front.below - front.columns;
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
      blas_.subtract_square(front.below, front.columns, panel(front) + front.columns, height, rest, front.below);
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
    T *own = x + front.first;
    const T *column = panel(front);
    for (int j = 0; j < front.columns; ++j, column += front.height()) {
      own[j] /= column[j];
      for (int i = j + 1; i < front.columns; ++i) own[i] -= column[i] * own[j];
    }
    std::fill(part, part + front.below, T(0));
    add_product(panel(front) + front.columns, front.height(), front.below, front.columns, own, part);
    const int32_t *row = rows(front);
    for (int i = 0; i < front.below; ++i) x[row[i]] -= part[i];
  }

  void backward(const Front &front, T *x, T *part) const {
    T *own = x + front.first;
    const int32_t *row = rows(front);
    std::copy(own, own + front.columns, part);
    for (int i = 0; i < front.below; ++i) part[front.columns + i] = x[row[i]];
    const T *column = panel(front) + static_cast<int64_t>(front.columns) * front.height();
    for (int j = front.columns - 1; j >= 0; --j) {
      column -= front.height();
      part[j] = (part[j] - product(column + j + 1, part + j + 1, front.height() - j - 1)) / column[j];
    }
    std::copy(part, part + front.columns, own);
  }

  // The same for several, row by row.
  void forward(const Front &front, T *x, T *part, int count) const {
    const int64_t step = count;
    const int height = front.height();
    T *own = x + step * front.first;
    if (std::all_of(own, own + step * front.columns, [](T number) { return number == 0; })) return;  // often: few loads
    blas_.divide("T", count, front.columns, panel(front), height, own, count);
    if (!front.below) return;
    blas_.subtract("T", count, front.below, front.columns, own, count, panel(front) + front.columns, height, 0, part,
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
      blas_.subtract("N", count, front.columns, front.below, part, count, panel(front) + front.columns, height, 1, own,
                     count);
    blas_.divide("N", count, front.columns, panel(front), height, own, count);
  }

  // into += A x for the (rows, columns) numbers of A; four columns at a time read and write `into` less often.
  static void add_product(const T *a, int height, int rows, int columns, const T *x, T *into) {
    const int64_t step = height;
    int j = 0;
    for (; j + 4 <= columns; j += 4, a += 4 * step) {
      const T *b = a + step, *c = b + step, *d = c + step;
      const T p = x[j], q = x[j + 1], r = x[j + 2], s = x[j + 3];
      for (int i = 0; i < rows; ++i) into[i] += (a[i] * p + b[i] * q) + (c[i] * r + d[i] * s);
    }
    for (; j < columns; ++j, a += step)
      for (int i = 0; i < rows; ++i) into[i] += a[i] * x[j];
  }

  // a·b of n numbers, in sums side by side that the processor takes at once.
  static T product(const T *a, const T *b, int n) {
    T sum[kLanes] = {}, all = 0;
    int i = 0;
    for (; i + kLanes <= n; i += kLanes)
      for (int k = 0; k < kLanes; ++k) sum[k] += a[i + k] * b[i + k];
    for (; i < n; ++i) all += a[i] * b[i];
    for (int k = 0; k < kLanes; ++k) all += sum[k];
    return all;
  }
};

}  // namespace cholesky
