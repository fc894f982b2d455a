#pragma once

// How the formulas of this folder are compiled.
//
// Each formula is a function template over a lane type: `float` (one value; reference form, CUDA) or a Highway vector
// (several rays, levels, neurons or parameters at a time). Highway compiles a source once per instruction set, each
// time in another namespace, so the headers here are included once per instruction set too: their guards flip with
// HWY_TARGET_TOGGLE, Highway's own idiom. A source that wants vectors defines ROMAP_MATH_SIMD before it includes them;
// every other source gets the plain form.

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
