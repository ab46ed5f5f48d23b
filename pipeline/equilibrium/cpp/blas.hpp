// The routines of BLAS that the factorisation needs, for both precisions; matrices column by column.
#pragma once

namespace cholesky {

template <typename T>
class Blas {
 public:
  Blas(void *gemm, void *syrk, void *trsm)
      : gemm_(reinterpret_cast<Gemm *>(gemm)),
        syrk_(reinterpret_cast<Syrk *>(syrk)),
        trsm_(reinterpret_cast<Trsm *>(trsm)) {}

  // C ← scale C − A op(B), C (m, n), A (m, k).
  void subtract(const char *op, int m, int n, int k, const T *a, int lda, const T *b, int ldb, T scale, T *c,
                int ldc) const {
    const T minus = -1;
    gemm_("N", op, &m, &n, &k, &minus, a, &lda, b, &ldb, &scale, c, &ldc);
  }

  // C ← C − A Aᵀ in the lower half, C (n, n), A (n, k).
  void subtract_square(int n, int k, const T *a, int lda, T *c, int ldc) const {
    const T minus = -1, one = 1;
    syrk_("L", "N", &n, &k, &minus, a, &lda, &one, c, &ldc);
  }

  // B ← B op(L)⁻¹, B (m, n), L lower.
  void divide(const char *op, int m, int n, const T *l, int ldl, T *b, int ldb) const {
    const T one = 1;
    trsm_("R", "L", op, "N", &m, &n, &one, l, &ldl, b, &ldb);
  }

 private:
  using Char = const char *;
  using Int = const int *;
  using Gemm = void(Char, Char, Int, Int, Int, const T *, const T *, Int, const T *, Int, const T *, T *, Int);
  using Syrk = void(Char, Char, Int, Int, const T *, const T *, Int, const T *, T *, Int);
  using Trsm = void(Char, Char, Char, Char, Int, Int, const T *, const T *, Int, T *, Int);

  Gemm *gemm_;
  Syrk *syrk_;
  Trsm *trsm_;
};

}  // namespace cholesky
