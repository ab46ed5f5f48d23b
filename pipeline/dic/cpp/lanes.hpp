// Sixteen floats at a time; the compiler lowers them to whatever the processor has.
#pragma once

#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__)
// One clone of the hot loops for each level of the instruction set; the loader picks the best one.
#define DIC_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default"), optimize("O3")))
#else
#define DIC_CLONES
#endif

namespace dic {

constexpr int kLanes = 16;
typedef float Lanes __attribute__((vector_size(64), aligned(4), may_alias));
typedef float Four __attribute__((vector_size(16), aligned(4), may_alias));

inline const Lanes *lanes(const float *p) { return reinterpret_cast<const Lanes *>(p); }
inline Lanes *lanes(float *p) { return reinterpret_cast<Lanes *>(p); }
#define DIC_SUM(v) ::dic::sum_of(reinterpret_cast<const float *>(&(v)))

inline double sum_of(const float *p) {
  double s = 0;
  for (int i = 0; i < kLanes; ++i) s += p[i];
  return s;
}

}  // namespace dic
