// Numbers side by side that a processor works on at once; the compiler cuts them to what it has.
#pragma once

#include "plan.hpp"

namespace cholesky {

template <typename T>
using Lanes __attribute__((vector_size(kLanes * sizeof(T)), aligned(alignof(T)), may_alias)) = T;

template <typename T>
Lanes<T> &lanes(T *at) {
  return *reinterpret_cast<Lanes<T> *>(at);
}

template <typename T>
const Lanes<T> &lanes(const T *at) {
  return *reinterpret_cast<const Lanes<T> *>(at);
}

// The sum of each of eight: of neighbours, of those of neighbours, of the two halves; compilers see shuffles in this.
template <typename T>
Lanes<T> sums(const Lanes<T> (&of)[kLanes]) {
  const auto twos = [&](int k) {
    const Lanes<T> &a = of[k], &b = of[k + 1];
    return Lanes<T>{a[0], b[0], a[2], b[2], a[4], b[4], a[6], b[6]} +
           Lanes<T>{a[1], b[1], a[3], b[3], a[5], b[5], a[7], b[7]};
  };
  const auto fours = [&](int k) {
    const Lanes<T> a = twos(k), b = twos(k + 2);
    return Lanes<T>{a[0], a[1], b[0], b[1], a[4], a[5], b[4], b[5]} +
           Lanes<T>{a[2], a[3], b[2], b[3], a[6], a[7], b[6], b[7]};
  };
  const Lanes<T> a = fours(0), b = fours(4);
  return Lanes<T>{a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]} +
         Lanes<T>{a[4], a[5], a[6], a[7], b[4], b[5], b[6], b[7]};
}

}  // namespace cholesky
