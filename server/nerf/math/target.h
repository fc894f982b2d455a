#pragma once

// Compilation of the formulas in this folder.
//
// Each formula is a function template over a lane type: `float` (one value; reference form, CUDA) or a Highway vector
// (several rays, levels, neurons or parameters at once). Highway compiles a source file once per instruction set, each
// time in another namespace, so these headers are also included once per instruction set: their include guards toggle
// with HWY_TARGET_TOGGLE, Highway's own idiom. A source file that needs vectors defines ROMAP_MATH_SIMD before it
// includes them; all other source files use the plain form.

#ifdef __CUDACC__
#define ROMAP_HD __host__ __device__ inline
#else
#define ROMAP_HD inline
#endif

#ifdef ROMAP_MATH_SIMD
#define ROMAP_MATH_BEGIN  \
  HWY_BEFORE_NAMESPACE(); \
  namespace romap::nerf::HWY_NAMESPACE {
#define ROMAP_MATH_END \
  }                    \
  HWY_AFTER_NAMESPACE();
#else
#define ROMAP_MATH_BEGIN namespace romap::nerf::plain {
#define ROMAP_MATH_END }
#endif
