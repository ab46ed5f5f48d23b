#include "cholesky.h"

#include <exception>

#include "factor.hpp"

struct CholeskyPlan {
  cholesky::Plan plan;
  cholesky::Blas<float> single;
  cholesky::Blas<double> full;
};

int32_t cholesky_interface() { return CHOLESKY_INTERFACE; }

CholeskyPlan *cholesky_new_plan(int64_t n, const int32_t *start, const int32_t *row, const CholeskyBlas *blas) {
  try {
    return new CholeskyPlan{cholesky::make_plan(n, start, row),
                            {blas->sgemm, blas->ssyrk, blas->strsm},
                            {blas->dgemm, blas->dsyrk, blas->dtrsm}};
  } catch (const std::exception &) {
    return nullptr;
  }
}

void cholesky_free_plan(CholeskyPlan *plan) { delete plan; }

CholeskyFactor *cholesky_new_factor(const CholeskyPlan *plan, const double *value, double smallest, int32_t bytes) {
  try {
    if (bytes == 4) return new cholesky::Factor<float>(plan->plan, plan->single, value, smallest);
    return new cholesky::Factor<double>(plan->plan, plan->full, value, smallest);
  } catch (const std::exception &) {
    return nullptr;
  }
}

void cholesky_free_factor(CholeskyFactor *factor) { delete factor; }

int64_t cholesky_raised(const CholeskyFactor *factor) { return factor->raised; }

void cholesky_last(const CholeskyFactor *factor, int64_t count, double *last) { factor->last(count, last); }

int32_t cholesky_solve(const CholeskyFactor *factor, double *side, int64_t count) {
  try {
    factor->solve(side, count);
    return 0;
  } catch (const std::exception &) {
    return 1;
  }
}
