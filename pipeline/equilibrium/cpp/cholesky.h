// Multifrontal Cholesky factors of stiffnesses, many of one pattern. Plain C at the border, called from
// ../cholesky.py. Dense work is done by the BLAS that is handed in.
#pragma once

#include <cstdint>

#define CHOLESKY_INTERFACE 2
#define CHOLESKY_API __attribute__((visibility("default")))

extern "C" {

// Routines of BLAS as Fortran calls them, with 32-bit integers.
struct CholeskyBlas {
  void *sgemm, *ssyrk, *strsm, *dgemm, *dsyrk, *dtrsm;
};

struct CholeskyPlan;    // what depends on the pattern alone
struct CholeskyFactor;  // its numbers

CHOLESKY_API int32_t cholesky_interface();

// The plan of a symmetric (n, n) pattern, both halves, rows ascending in every column, in a good order of elimination;
// null if memory fails or a diagonal entry is missing.
CHOLESKY_API CholeskyPlan *cholesky_new_plan(int64_t n, const int32_t *start, const int32_t *row,
                                             const CholeskyBlas *blas);
CHOLESKY_API void cholesky_free_plan(CholeskyPlan *plan);

// The factor of a matrix with the entries `value`, in the order of the pattern, in numbers of 4 or 8 bytes; its plan
// must outlive it. Pivots below `smallest` of the diagonal entry they come from are raised to that. Null if memory
// fails.
CHOLESKY_API CholeskyFactor *cholesky_new_factor(const CholeskyPlan *plan, const double *value, double smallest,
                                                 int32_t bytes);
CHOLESKY_API void cholesky_free_factor(CholeskyFactor *factor);

// How many pivots were raised.
CHOLESKY_API int64_t cholesky_raised(const CholeskyFactor *factor);

// The last (count, count) numbers of the factor, row by row, zero above the diagonal.
CHOLESKY_API void cholesky_last(const CholeskyFactor *factor, int64_t count, double *last);

// Solves in place of `count` right-hand sides, (n, count) numbers row by row. Nonzero if memory fails.
CHOLESKY_API int32_t cholesky_solve(const CholeskyFactor *factor, double *side, int64_t count);
}
