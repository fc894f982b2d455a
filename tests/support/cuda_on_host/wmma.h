#pragma once

// Scalar replacements for nvcuda::wmma. The elements of a fragment are assigned to the lanes of a warp in a scrambled
// order: the order on devices is unspecified, and code that relies on it must fail here.

#include <cstdint>
#include <type_traits>

#include "tests/support/cuda_on_host/device_builtins.h"

// NOLINTBEGIN: CUDA's names, not ours
namespace nvcuda::wmma {

struct matrix_a {};
struct matrix_b {};
struct accumulator {};
struct row_major {};
struct col_major {};
enum layout_t { mem_row_major, mem_col_major };

// Element `index` of lane `lane` is number 32 * index + (lane ^ kScramble) of the row-major matrix.
template <class Use, int M, int N, int K, class T, class Layout = void>
struct fragment {
  static constexpr int kRows = std::is_same_v<Use, matrix_b> ? K : M;
  static constexpr int kCols = std::is_same_v<Use, matrix_a> ? K : N;
  static constexpr int kScramble = 5;
  static constexpr int num_elements = kRows * kCols / 32;
  T x[num_elements];

  static int Row(int lane, int index) { return (32 * index + (lane ^ kScramble)) / kCols; }
  static int Col(int lane, int index) { return (32 * index + (lane ^ kScramble)) % kCols; }
  static int LaneOf(int row, int col) { return (row * kCols + col) % 32 ^ kScramble; }
  static int IndexOf(int row, int col) { return (row * kCols + col) / 32; }
};

// Synchronizes the lanes for an operation without ordering their memory accesses.
inline void Rendezvous() { romap::cuda_on_host::WarpRendezvous(0xffffffffu); }

// Checks the alignment that devices require for loads and stores.
template <class T>
void CheckAccess(const T* p, unsigned leading_dimension) {
  if (reinterpret_cast<uintptr_t>(p) % 32 != 0) romap::cuda_on_host::Die("wmma pointer is not aligned to 32 bytes");
  if (leading_dimension * sizeof(T) % 16 != 0) {
    romap::cuda_on_host::Die("wmma leading dimension is not a multiple of 16 bytes");
  }
}

template <class Fragment, class T>
void fill_fragment(Fragment& f, T value) {
  for (auto& element : f.x) element = value;
  Rendezvous();
}

template <class Use, int M, int N, int K, class T, class Layout>
void load_matrix_sync(fragment<Use, M, N, K, T, Layout>& f, const T* p, unsigned leading_dimension) {
  CheckAccess(p, leading_dimension);
  Rendezvous();
  const int lane = static_cast<int>(romap::cuda_on_host::Lane());
  for (int i = 0; i < f.num_elements; ++i) {
    const unsigned row = static_cast<unsigned>(f.Row(lane, i));
    const unsigned col = static_cast<unsigned>(f.Col(lane, i));
    f.x[i] = std::is_same_v<Layout, row_major> ? p[row * leading_dimension + col] : p[col * leading_dimension + row];
  }
  Rendezvous();
}

template <int M, int N, int K, class T>
void load_matrix_sync(fragment<accumulator, M, N, K, T>& f, const T* p, unsigned leading_dimension, layout_t layout) {
  CheckAccess(p, leading_dimension);
  Rendezvous();
  const int lane = static_cast<int>(romap::cuda_on_host::Lane());
  for (int i = 0; i < f.num_elements; ++i) {
    const unsigned row = static_cast<unsigned>(f.Row(lane, i));
    const unsigned col = static_cast<unsigned>(f.Col(lane, i));
    f.x[i] = layout == mem_row_major ? p[row * leading_dimension + col] : p[col * leading_dimension + row];
  }
  Rendezvous();
}

template <int M, int N, int K, class T>
void store_matrix_sync(T* p, const fragment<accumulator, M, N, K, T>& f, unsigned leading_dimension, layout_t layout) {
  CheckAccess(p, leading_dimension);
  Rendezvous();
  const int lane = static_cast<int>(romap::cuda_on_host::Lane());
  for (int i = 0; i < f.num_elements; ++i) {
    const unsigned row = static_cast<unsigned>(f.Row(lane, i));
    const unsigned col = static_cast<unsigned>(f.Col(lane, i));
    p[layout == mem_row_major ? row * leading_dimension + col : col * leading_dimension + row] = f.x[i];
  }
  Rendezvous();
}

// Number of matrix products since the program started.
inline std::atomic<uint64_t> tile_products{0};

// d = a * b + c, summed in float.
template <int M, int N, int K, class TD, class TA, class LA, class LB>
void mma_sync(fragment<accumulator, M, N, K, TD>& d, const fragment<matrix_a, M, N, K, TA, LA>& a,
              const fragment<matrix_b, M, N, K, TA, LB>& b, const fragment<accumulator, M, N, K, TD>& c) {
  using A = fragment<matrix_a, M, N, K, TA, LA>;
  using B = fragment<matrix_b, M, N, K, TA, LB>;
  using romap::cuda_on_host::SlotOfLane;
  const unsigned lane = romap::cuda_on_host::Lane();
  if (lane == 0) ++tile_products;
  SlotOfLane(lane).pointers[0] = &a;
  SlotOfLane(lane).pointers[1] = &b;
  Rendezvous();
  TD result[fragment<accumulator, M, N, K, TD>::num_elements];
  for (int i = 0; i < d.num_elements; ++i) {
    const int row = d.Row(static_cast<int>(lane), i);
    const int col = d.Col(static_cast<int>(lane), i);
    float sum = 0;
    for (int k = 0; k < K; ++k) {
      const auto* owner_a = static_cast<const A*>(SlotOfLane(static_cast<unsigned>(A::LaneOf(row, k))).pointers[0]);
      const auto* owner_b = static_cast<const B*>(SlotOfLane(static_cast<unsigned>(B::LaneOf(k, col))).pointers[1]);
      sum += static_cast<float>(owner_a->x[A::IndexOf(row, k)]) * static_cast<float>(owner_b->x[B::IndexOf(k, col)]);
    }
    result[i] = static_cast<TD>(static_cast<float>(c.x[i]) + sum);
  }
  Rendezvous();
  for (int i = 0; i < d.num_elements; ++i) d.x[i] = result[i];
}

}  // namespace nvcuda::wmma
// NOLINTEND
