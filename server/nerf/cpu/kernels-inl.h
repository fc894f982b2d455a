// The inner loops as templates over lane types: memory and loops; the formulas are in math/. Included by
// plain_kernels.cc with floats and by simd_kernels.cc once per instruction set with vectors.
#include <algorithm>
#include <cstring>

#include "server/nerf/cpu/distance_kernels-inl.h"
#include "server/nerf/cpu/kernels.h"
#include "server/nerf/math/activation.h"
#include "server/nerf/math/adam.h"
#include "server/nerf/math/composite.h"
#include "server/nerf/math/dense.h"
#include "server/nerf/math/hash_grid.h"
#include "server/nerf/math/losses.h"
#include "server/nerf/math/ray.h"
#include "server/nerf/math/sample_budget.h"
#include "server/nerf/math/sampling.h"

#if defined(ROMAP_NERF_CPU_KERNELS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_CPU_KERNELS_INL
#else
#define ROMAP_NERF_CPU_KERNELS_INL
#endif

ROMAP_MATH_BEGIN

// ----------------------------------------------------------------------------------------------------------- sampling

// Finds the occupied pieces of a ray (math/sampling.h), of length `piece` from `entry` on: their numbers, ascending, in
// occupied[kRayProbes + kMaxLanes]. Returns the number of occupied pieces.
template <class Wide>
int FindOccupied(const RayInCells<Wide>& ray, const SamplingRule& rule, float entry, float piece, float* occupied) {
  using L = Lane<Wide>;
  int count = 0;
  for (int i = 0; i < kRayProbes; i += L::kLanes) {
    const Wide number = L::Iota() + L::Set(static_cast<float>(i));
    if (rule.budget.skip_empty) {
      const auto cell = ray.CellAt(PieceCenter(number, L::Set(piece), L::Set(entry)));
      const auto word = L::Gather(rule.occupied_bits, L::WordOfBit(cell));
      count += L::StoreWhereBit(number, word, cell, occupied + count);
    } else {
      L::Store(number, occupied + i);
      count += L::kLanes;
    }
  }
  return count;
}

// Spreads `count` samples evenly over the occupied pieces of a ray, as if these were joined into one segment.
template <class Wide>
void SpreadSamples(const Ray& ray, const RayInCells<Wide>& in_cells, const SamplingRule& rule, float entry, float piece,
                   const float* occupied, int occupied_count, int count, SampleChunk& chunk) {
  using L = Lane<Wide>;
  const float pieces_per_sample = static_cast<float>(occupied_count) / static_cast<float>(count);
  const Wide last_piece = L::Set(static_cast<float>(occupied_count - 1));
  for (int i = 0; i < count; i += L::kLanes) {
    const int to = chunk.size + i;
    const Wide number = L::Iota() + L::Set(static_cast<float>(i) + ray.jitter);
    const Wide at = number * L::Set(pieces_per_sample);
    const Wide joined = JoinedPieceAt(at, last_piece);
    const Wide pieces = L::Gather(occupied, L::WholeToInt(joined)) + (at - joined);
    const Wide t = PositionOnRay(pieces, L::Set(piece), L::Set(entry));
    L::Store(t, chunk.t.data() + to);
    L::Store(L::Set(piece * pieces_per_sample), chunk.length.data() + to);
    L::StoreInt(in_cells.CellAt(t), chunk.cell.data() + to);
    float* const position[3] = {chunk.x.data() + to, chunk.y.data() + to, chunk.z.data() + to};
    for (int a = 0; a < 3; ++a) {
      L::Store(SampleCoordinate(L::Set(ray.origin[a]), L::Set(ray.direction[a]), t, L::Set(rule.extent[a])),
               position[a]);
    }
  }
}

template <class Wide>
void PlaceSamples(const Ray* rays, int ray_count, const SamplingRule& rule, SampleChunk& chunk, RaySpan* spans) {
  float occupied[kRayProbes + kMaxLanes];
  for (int r = 0; r < ray_count; ++r) {
    const Ray& ray = rays[r];
    spans[r] = {chunk.size, 0};
    float entry, exit;
    if (!IntersectBox(ray.origin, ray.direction, rule.extent.data(), entry, exit)) continue;
    const float piece = (exit - entry) / kRayProbes;
    const RayInCells<Wide> in_cells(ray, rule.extent.data());
    const int occupied_count = FindOccupied(in_cells, rule, entry, piece, occupied);
    const int count = SampleCount(rule.budget, piece * static_cast<float>(occupied_count));
    if (count == 0) continue;
    SpreadSamples(ray, in_cells, rule, entry, piece, occupied, occupied_count, count, chunk);
    spans[r].count = count;
    chunk.size += count;
  }
}

// ----------------------------------------------------------------------------------------------------------- encoding

template <class Wide>
void ToGrid(const GridPose& pose, int count, float* x, float* y, float* z) {
  using L = Lane<Wide>;
  for (int i = 0; i < count; i += L::kLanes) {
    Wide px = L::Load(x + i), py = L::Load(y + i), pz = L::Load(z + i);
    MoveToGrid(pose, px, py, pz);
    L::Store(px, x + i);
    L::Store(py, y + i);
    L::Store(pz, z + i);
  }
}

// The plain form, one level after the other. Vector targets use vector_encode-inl.h instead.

inline GridCell<float> LocateOnLevel(const GridLayout& layout, int level, float x, float y, float z) {
  return LocateCell(x, y, z, layout.scale[level], layout.stride_y[level], layout.stride_z[level], layout.mask[level],
                    layout.offset[level]);
}

inline void Encode(const GridLayout& layout, const float* table, int count, const float* x, const float* y,
                   const float* z, float* features) {
  for (int i = 0; i < count; ++i, features += layout.features) {
    for (int level = 0; level < layout.levels; ++level) {
      const GridCell<float> cell = LocateOnLevel(layout, level, x[i], y[i], z[i]);
      InterpolateCell<Quad>(table, cell.pair, cell.weight, cell.along_x, 1, features + kFeaturesPerLevel * level);
    }
    for (int f = kFeaturesPerLevel * layout.levels; f < layout.features; ++f) features[f] = 0.0f;
  }
}

inline void EncodeBackward(const GridLayout& layout, int count, const float* x, const float* y, const float* z,
                           const float* d_features, float* gradient) {
  for (int i = 0; i < count; ++i, d_features += layout.features) {
    for (int level = 0; level < layout.levels; ++level) {
      const GridCell<float> cell = LocateOnLevel(layout, level, x[i], y[i], z[i]);
      ScatterCell<Quad>(gradient, cell.pair, cell.weight, cell.along_x, 1, d_features + kFeaturesPerLevel * level);
    }
  }
}

// ---------------------------------------------------------------------------------------------------------------- MLP

// out[rows][n] = a[rows][k_count] b[k_count][n], computed in register tiles.
template <class F, DenseMode kMode, int kRows, int kGroups>
void DenseInTiles(int rows, const float* a, int k_count, const float* b, int n, float* out) {
  constexpr int kColumns = kGroups * Lane<F>::kLanes;
  int row = 0;
  for (; row + kRows <= rows; row += kRows) {
    for (int c = 0; c < n; c += kColumns) {
      DenseTile<F, kRows, kGroups, kMode>(a + row * k_count, k_count, k_count, b + c, n, out + row * n + c);
    }
  }
  for (; row < rows; ++row) {
    for (int c = 0; c < n; c += kColumns) {
      DenseTile<F, 1, kGroups, kMode>(a + row * k_count, k_count, k_count, b + c, n, out + row * n + c);
    }
  }
}

template <class F, DenseMode kMode>
void Dense(int rows, const float* a, int k_count, const float* b, int n, float* out) {
  if (n % (2 * Lane<F>::kLanes) == 0) {
    DenseInTiles<F, kMode, 6, 2>(rows, a, k_count, b, n, out);
  } else {
    DenseInTiles<F, kMode, 8, 1>(rows, a, k_count, b, n, out);
  }
}

// out[k_count][n] += a[samples][k_count]^T b[samples][n]; k_count a multiple of 4.
template <class F>
void Outer(int samples, const float* a, int k_count, const float* b, int n, float* out) {
  constexpr int kLanes = Lane<F>::kLanes;
  const bool pairs = n % (2 * kLanes) == 0;
  for (int k = 0; k < k_count; k += 4) {
    for (int c = 0; c < n; c += pairs ? 2 * kLanes : kLanes) {
      if (pairs) {
        OuterTile<F, 4, 2>(samples, a + k, k_count, b + c, n, out + k * n + c);
      } else {
        OuterTile<F, 4, 1>(samples, a + k, k_count, b + c, n, out + k * n + c);
      }
    }
  }
}

inline constexpr int kMlpBlock = 96;  // samples whose activations fit into the L1 cache

// The output layer as an ordinary product.
struct OutputByRows {
  static void Run(const MlpWeights& mlp, int samples, const float* hidden, float* raw) {
    Dense<float, DenseMode::kLinear>(samples, hidden, mlp.hidden, mlp.out_transposed.data(), kOutputs, raw);
  }
};

template <class Wide, class Output>
void MlpForward(const MlpWeights& mlp, int count, const float* features, float* hidden, float* raw) {
  for (int begin = 0; begin < count; begin += kMlpBlock) {
    const int n = std::min(kMlpBlock, count - begin);
    float* block = hidden + begin * mlp.hidden;
    Dense<Wide, DenseMode::kRelu>(n, features + begin * mlp.inputs, mlp.inputs, mlp.in_weights(), mlp.hidden, block);
    Output::Run(mlp, n, block, raw + begin * kOutputs);
  }
}

template <class Wide>
void MlpBackward(const MlpWeights& mlp, int count, float* features, float* hidden, const float* d_raw,
                 float* gradient) {
  for (int begin = 0; begin < count; begin += kMlpBlock) {
    const int n = std::min(kMlpBlock, count - begin);
    float* x = features + begin * mlp.inputs;
    float* h = hidden + begin * mlp.hidden;
    const float* d = d_raw + begin * kOutputs;
    Outer<Wide>(n, d, kOutputs, h, mlp.hidden, gradient + mlp.inputs * mlp.hidden);
    Dense<Wide, DenseMode::kMaskedByOut>(n, d, kOutputs, mlp.out_weights(), mlp.hidden, h);
    Outer<Wide>(n, x, mlp.inputs, h, mlp.hidden, gradient);
    Dense<Wide, DenseMode::kLinear>(n, h, mlp.hidden, mlp.in_transposed.data(), mlp.inputs, x);
  }
}

// ------------------------------------------------------------------------------------------------- activation and Adam

template <class Wide>
void Activate(SampleChunk& chunk, float density_bias) {
  using L = Lane<Wide>;
  for (int i = 0; i < chunk.size; i += L::kLanes) {
    Wide red, green, blue, raw;
    L::Load4(chunk.raw.data() + kOutputs * i, red, green, blue, raw);
    const Wide density = Density(raw + L::Set(density_bias));
    L::Store(Sigmoid(red), chunk.red.data() + i);
    L::Store(Sigmoid(green), chunk.green.data() + i);
    L::Store(Sigmoid(blue), chunk.blue.data() + i);
    L::Store(density, chunk.density.data() + i);
    L::Store(StepOpacity(density, L::Load(chunk.length.data() + i)), chunk.alpha.data() + i);
  }
}

inline RaySamples SamplesOf(const RaySpan& span, const SampleChunk& c) {
  const int at = span.first;
  return {span.count,          c.t.data() + at,       c.length.data() + at,
          c.alpha.data() + at, c.density.data() + at, {c.red.data() + at, c.green.data() + at, c.blue.data() + at}};
}

inline void Composite(const Ray* rays, const RaySpan* spans, int ray_count, const LossWeights& weights, SampleChunk& c,
                      RayResult* results) {
  for (int r = 0; r < ray_count; ++r) {
    if (spans[r].count == 0) continue;
    const int at = spans[r].first;
    results[r] =
        CompositeForward(SamplesOf(spans[r], c), rays[r].target.depth, c.weight.data() + at, c.behind.data() + at);
  }
  for (int r = 0; r < ray_count; ++r) {
    if (spans[r].count == 0) continue;
    const RayTarget& target = rays[r].target;
    const int partner = r + target.partner;
    const bool has_partner = partner != r && partner >= 0 && partner < ray_count && spans[partner].count > 0;
    float partner_error[3] = {};
    if (has_partner) ColorError(results[partner], rays[partner].target, weights, partner_error);
    const RayLoss loss = LossOfRay(results[r], target, weights, has_partner, partner_error);
    results[r].loss = loss.value;
    results[r].color_loss = loss.color;
    const int at = spans[r].first;
    CompositeBackward(SamplesOf(spans[r], c), target.depth, loss, c.weight.data() + at, c.behind.data() + at,
                      c.d_raw.data() + kOutputs * at);
  }
}

template <class Wide>
int KeepActive(float cut, float scale, int features, int hidden, SampleChunk& c) {
  using L = Lane<Wide>;
  int active = 0;
  for (int i = 0; i < c.size; i += L::kLanes) {
    Wide red, green, blue, density;
    L::Load4(c.d_raw.data() + kOutputs * i, red, green, blue, density);
    // Lanes after the last sample are excluded.
    const Wide size = L::FirstLanes(c.size - i, GradientSize(red, green, blue, density));
    active += L::StoreWhereGreater(size, L::Set(cut), L::IotaInt(static_cast<uint32_t>(i)), c.active.data() + active);
  }
  const auto move_row = [](float* rows, int width, uint32_t from, int to) {
    for (int f = 0; f < width; f += L::kLanes) L::Store(L::Load(rows + from * width + f), rows + to * width + f);
  };
  for (int to = 0; to < active; ++to) {
    const uint32_t from = c.active[to];
    c.x[to] = c.x[from];
    c.y[to] = c.y[from];
    c.z[to] = c.z[from];
    for (int o = 0; o < kOutputs; ++o) c.d_raw[kOutputs * to + o] = c.d_raw[kOutputs * from + o] * scale;
    move_row(c.features.data(), features, from, to);
    move_row(c.hidden.data(), hidden, from, to);
  }
  return active;
}

template <class Wide>
void Adam(const AdamRates& rates, size_t begin, size_t end, float* parameters, float* first, float* second,
          float* const* gradients, int gradient_count) {
  using L = Lane<Wide>;
  for (size_t i = begin; i < end; i += L::kLanes) {
    Wide gradient = L::Load(gradients[0] + i);
    for (int g = 1; g < gradient_count; ++g) gradient = gradient + L::Load(gradients[g] + i);
    if (L::AllZero(gradient)) continue;  // true for most entries of the fine levels in any one step
    for (int g = 0; g < gradient_count; ++g) L::Store(L::Zero(), gradients[g] + i);
    Wide p = L::Load(parameters + i), m = L::Load(first + i), v = L::Load(second + i);
    AdamUpdate(gradient, rates, p, m, v);
    L::Store(p, parameters + i);
    L::Store(m, first + i);
    L::Store(v, second + i);
  }
}

// Wide: the lane type of this instruction set. Output: computes the output layer of the MLP.
template <class Wide, class Output>
KernelTable MakeKernelTable(const char* name) {
  return {.name = name,
          .place_samples = PlaceSamples<Wide>,
          .to_grid = ToGrid<Wide>,
          .encode = Encode,
          .encode_backward = EncodeBackward,
          .mlp_forward = MlpForward<Wide, Output>,
          .mlp_backward = MlpBackward<Wide>,
          .activate = Activate<Wide>,
          .distance_opacity = DistanceOpacity<Wide>,
          .distance_backward = DistanceOpacityBackward,
          .composite = Composite,
          .keep_active = KeepActive<Wide>,
          .adam = Adam<Wide>};
}

ROMAP_MATH_END

#endif
