// Small symmetric systems.
#pragma once
#include <array>
#include <cmath>

namespace dic {

// Inverse of the leading n×n block of a symmetric positive matrix kept in rows of `stride`; false where singular.
inline bool invert_symmetric(const double *a, int n, int stride, double *inverse) {
  double l[36];  // Cholesky factor
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= i; ++j) {
      double s = a[i * stride + j];
      for (int k = 0; k < j; ++k) s -= l[i * 6 + k] * l[j * 6 + k];
      if (i == j) {
        if (!(s > 1e-12 * a[i * stride + i]) || !(s > 0)) return false;
        l[i * 6 + i] = std::sqrt(s);
      } else {
        l[i * 6 + j] = s / l[j * 6 + j];
      }
    }
  for (int c = 0; c < n; ++c) {
    double x[6];
    for (int i = 0; i < n; ++i) {
      double s = i == c;
      for (int k = 0; k < i; ++k) s -= l[i * 6 + k] * x[k];
      x[i] = s / l[i * 6 + i];
    }
    for (int i = n - 1; i >= 0; --i) {
      double s = x[i];
      for (int k = i + 1; k < n; ++k) s -= l[k * 6 + i] * x[k];
      x[i] = s / l[i * 6 + i];
    }
    for (int i = 0; i < n; ++i) inverse[i * stride + c] = x[i];
  }
  return true;
}

}  // namespace dic
