#include "server/nerf/cpu/distance_fit.h"

#include <array>
#include <cmath>

#include "server/nerf/math/random.h"
#include "server/nerf/model/step_parameters.h"

namespace romap::nerf {
namespace {

constexpr int kSteps = 30;
constexpr int kChunks = 4;     // per step
constexpr int kPoints = 1024;  // per chunk
constexpr float kNear = 0.1f;  // box sides; most points are closer than this to the surface
constexpr int kTries = 4;      // random cells drawn at most to find one near the surface
constexpr uint64_t kSeed = 99;

class DistanceFit {
 public:
  DistanceFit(const NerfConfig& config, const KernelTable& kernels, TrainingState& field)
      : kernels_(kernels),
        field_(field),
        rates_(MakeAdamRates(config, static_cast<float>(config.learning_rate))),
        points_(kPoints, field.model.layout.features, field.model.mlp.hidden),
        table_gradient_(field.model.table.size() + kMaxLanes),
        mlp_gradient_(field.model.mlp.parameters.size()) {}

  void Step(const StepSource& source, std::span<const float> distance, int step) {
    for (int chunk = 0; chunk < kChunks; ++chunk) {
      PlacePoints(source, distance, static_cast<uint64_t>(step * kChunks + chunk));
      AddGradients(distance);
    }
    const auto update = [&](AlignedBuffer<float>& parameters, AlignedBuffer<float>& first, AlignedBuffer<float>& second,
                            AlignedBuffer<float>& gradient) {
      float* const gradients[1] = {gradient.data()};
      kernels_.adam(rates_, 0, parameters.size(), parameters.data(), first.data(), second.data(), gradients, 1);
    };
    update(field_.model.table, field_.table_first, field_.table_second, table_gradient_);
    update(field_.model.mlp.parameters, field_.mlp_first, field_.mlp_second, mlp_gradient_);
    field_.model.mlp.UpdateTransposed();
  }

 private:
  void PlacePoints(const StepSource& source, std::span<const float> distance, uint64_t chunk) {
    points_.size = kPoints;
    for (int i = 0; i < kPoints; ++i) {
      uint32_t cell = 0;
      for (int tries = 0; tries < kTries; ++tries) {
        cell = static_cast<uint32_t>(RandomBits(kSeed, chunk, static_cast<uint64_t>(i * kTries + tries)) %
                                     distance.size());
        if (std::fabs(distance[cell]) < kNear) break;
      }
      constexpr uint32_t kSide = kOccupancyResolution;
      const auto center = [&](uint32_t index, int axis) {
        return source.extent[static_cast<size_t>(axis)] * (static_cast<float>(index % kSide) + 0.5f) / kSide;
      };
      points_.cell[i] = cell;
      points_.x[i] = center(cell, 0);
      points_.y[i] = center(cell / kSide, 1);
      points_.z[i] = center(cell / (kSide * kSide), 2);
    }
    kernels_.to_grid(source.grid, kPoints, points_.x.data(), points_.y.data(), points_.z.data());
  }

  void AddGradients(std::span<const float> distance) {
    SampleChunk& p = points_;
    const FieldModel& model = field_.model;
    kernels_.encode(model.layout, model.table.data(), kPoints, p.x.data(), p.y.data(), p.z.data(), p.features.data());
    kernels_.mlp_forward(model.mlp, kPoints, p.features.data(), p.hidden.data(), p.raw.data());
    for (int i = 0; i < kPoints; ++i) {
      const float error = -kDistancePerRaw * p.raw[kOutputs * i + 3] - distance[p.cell[i]];
      float* d = p.d_raw.data() + kOutputs * i;
      d[0] = d[1] = d[2] = 0;
      d[3] = -kDistancePerRaw * 2 * error / (kChunks * kPoints);
    }
    kernels_.mlp_backward(model.mlp, kPoints, p.features.data(), p.hidden.data(), p.d_raw.data(), mlp_gradient_.data());
    kernels_.encode_backward(model.layout, kPoints, p.x.data(), p.y.data(), p.z.data(), p.features.data(),
                             table_gradient_.data());
  }

  const KernelTable& kernels_;
  TrainingState& field_;
  AdamRates rates_;
  SampleChunk points_;
  AlignedBuffer<float> table_gradient_, mlp_gradient_;
};

}  // namespace

void FitDistances(const NerfConfig& config, const KernelTable& kernels, const StepSource& source,
                  std::span<const float> distance, TrainingState& field) {
  DistanceFit fit(config, kernels, field);
  for (int step = 0; step < kSteps; ++step) fit.Step(source, distance, step);
}

}  // namespace romap::nerf
