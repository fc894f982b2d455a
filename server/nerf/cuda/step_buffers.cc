#include "server/nerf/cuda/step_buffers.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "server/nerf/model/step_parameters.h"

namespace romap::nerf::cuda {
namespace {

template <class T>
absl::Status Zero(DeviceArray<T>& array, cudaStream_t stream) {
  return ToStatus(cudaMemsetAsync(array.data(), 0, array.bytes(), stream), "clear memory");
}

template <class T>
absl::Status AllocateInto(DeviceArray<T>& array, size_t count) {
  ROMAP_ASSIGN_OR_RETURN(array, DeviceArray<T>::Allocate(count));
  return absl::OkStatus();
}

std::vector<uint32_t> PackBits(std::span<const uint8_t> cells) {
  std::vector<uint32_t> bits(cells.size() / 32);
  for (size_t i = 0; i < cells.size(); ++i) bits[i / 32] |= uint32_t{cells[i] != 0} << (i % 32);
  return bits;
}

}  // namespace

absl::StatusOr<StepBuffers> StepBuffers::Create(const NerfConfig& config, const FieldModel& model, int steps) {
  StepBuffers buffers;
  const int step_blocks = StepBlocks(config.rays_per_step, config.max_samples_per_ray);
  ROMAP_RETURN_IF_ERROR(buffers.Allocate(model, config.rays_per_step, steps, step_blocks));
  buffers.DescribeLaunch(config, model, step_blocks);
  return buffers;
}

absl::Status StepBuffers::Allocate(const FieldModel& model, int rays_per_step, int steps, int step_blocks) {
  const size_t table = model.table.size(), mlp = model.mlp.parameters.size();
  const size_t ray_count = static_cast<size_t>(steps) * static_cast<size_t>(rays_per_step);
  for (DeviceArray<float>* array : {&table_, &table_first_, &table_second_, &table_gradient_}) {
    ROMAP_RETURN_IF_ERROR(AllocateInto(*array, table));
  }
  for (DeviceArray<float>* array : {&mlp_, &mlp_first_, &mlp_second_}) ROMAP_RETURN_IF_ERROR(AllocateInto(*array, mlp));
  ROMAP_RETURN_IF_ERROR(AllocateInto(mlp_partial_, mlp * static_cast<size_t>(step_blocks)));
  ROMAP_RETURN_IF_ERROR(AllocateInto(rays, ray_count));
  ROMAP_RETURN_IF_ERROR(AllocateInto(color_loss, ray_count));
  ROMAP_RETURN_IF_ERROR(AllocateInto(learning_rate, static_cast<size_t>(steps)));
  ROMAP_RETURN_IF_ERROR(AllocateInto(slice, 1));
  ROMAP_RETURN_IF_ERROR(AllocateInto(counters, 1));
  ROMAP_RETURN_IF_ERROR(AllocateInto(score_, kCells));
  ROMAP_RETURN_IF_ERROR(AllocateInto(cell_visits_, kCells));
  ROMAP_RETURN_IF_ERROR(AllocateInto(cell_weight_, kCells));
  for (DeviceArray<uint32_t>* array : {&hull_bits_, &live_bits_, &occupied_bits_}) {
    ROMAP_RETURN_IF_ERROR(AllocateInto(*array, kCells / 32));
  }
  return AllocateInto(layer_weight_, kLayers);
}

void StepBuffers::DescribeLaunch(const NerfConfig& config, const FieldModel& model, int step_blocks) {
  const OccupancyPlan plan = MakeOccupancyPlan(config);
  const AdamRates rates = MakeAdamRates(config, 0);
  launch_.step = {.field = {model.layout, table_.data(), mlp_.data(), model.mlp.hidden, model.density_bias},
                  .slice = slice.data(),
                  .counters = counters.data(),
                  .rays = rays.data(),
                  .color_loss = color_loss.data(),
                  .rays_per_step = config.rays_per_step,
                  .budget = MakeSampleBudget(config),
                  .loss_weights = MakeLossWeights(config),
                  .gradient_cut = static_cast<float>(config.min_sample_gradient),
                  .occupied_bits = occupied_bits_.data(),
                  .cell_visits = cell_visits_.data(),
                  .cell_weight = cell_weight_.data(),
                  .layer_weight = layer_weight_.data(),
                  .table_gradient = table_gradient_.data(),
                  .mlp_partial = mlp_partial_.data()};
  launch_.optimize = {.slice = slice.data(),
                      .learning_rate = learning_rate.data(),
                      .beta1 = rates.beta1,
                      .beta2 = rates.beta2,
                      .table_count = table_.size(),
                      .table = table_.data(),
                      .table_first = table_first_.data(),
                      .table_second = table_second_.data(),
                      .table_gradient = table_gradient_.data(),
                      .mlp_count = static_cast<int>(mlp_.size()),
                      .mlp = mlp_.data(),
                      .mlp_first = mlp_first_.data(),
                      .mlp_second = mlp_second_.data(),
                      .mlp_partial = mlp_partial_.data(),
                      .step_blocks = step_blocks,
                      .score = score_.data(),
                      .cell_visits = cell_visits_.data(),
                      .cell_weight = cell_weight_.data(),
                      .decay = static_cast<float>(config.occupancy_decay),
                      .threshold = static_cast<float>(config.occupancy_threshold),
                      .plan = plan,
                      .hull_bits = hull_bits_.data(),
                      .live_bits = live_bits_.data()};
  launch_.occupancy = {.slice = slice.data(),
                       .plan = plan,
                       .live_bits = live_bits_.data(),
                       .hull_bits = hull_bits_.data(),
                       .occupied_bits = occupied_bits_.data(),
                       .layer_weight = layer_weight_.data()};
}

absl::Status StepBuffers::Upload(const TrainingState& field, const Occupancy& occupancy, cudaStream_t stream) {
  const Occupancy::State cells = occupancy.state();
  const std::vector<uint32_t> hull_bits = PackBits(occupancy.hull());
  std::vector<unsigned long long> layers;
  for (const auto& axis : cells.layer_weight) {
    for (const double weight : axis) layers.push_back(static_cast<unsigned long long>(weight / kLayerUnit));
  }
  const std::pair<DeviceArray<float>*, std::span<const float>> copies[] = {{&table_, field.model.table.span()},
                                                                           {&table_first_, field.table_first.span()},
                                                                           {&table_second_, field.table_second.span()},
                                                                           {&mlp_, field.model.mlp.parameters.span()},
                                                                           {&mlp_first_, field.mlp_first.span()},
                                                                           {&mlp_second_, field.mlp_second.span()},
                                                                           {&score_, cells.score}};
  for (const auto& [to, from] : copies) {
    ROMAP_RETURN_IF_ERROR(CopyToDevice(to->data(), from.data(), from.size_bytes(), stream));
  }
  ROMAP_RETURN_IF_ERROR(CopyToDevice(occupied_bits_.data(), cells.bits.data(), occupied_bits_.bytes(), stream));
  ROMAP_RETURN_IF_ERROR(CopyToDevice(hull_bits_.data(), hull_bits.data(), hull_bits_.bytes(), stream));
  ROMAP_RETURN_IF_ERROR(CopyToDevice(layer_weight_.data(), layers.data(), layer_weight_.bytes(), stream));
  ROMAP_RETURN_IF_ERROR(Zero(table_gradient_, stream));
  ROMAP_RETURN_IF_ERROR(Zero(cell_visits_, stream));
  ROMAP_RETURN_IF_ERROR(Zero(cell_weight_, stream));
  ROMAP_RETURN_IF_ERROR(Zero(counters, stream));
  return Synchronize(stream);  // the vectors above must live until the copies are done
}

absl::Status StepBuffers::Download(TrainingState& field, Occupancy& occupancy, cudaStream_t stream) {
  const std::pair<DeviceArray<float>*, float*> copies[] = {
      {&table_, field.model.table.data()},         {&table_first_, field.table_first.data()},
      {&table_second_, field.table_second.data()}, {&mlp_, field.model.mlp.parameters.data()},
      {&mlp_first_, field.mlp_first.data()},       {&mlp_second_, field.mlp_second.data()}};
  std::vector<std::vector<float>> arrived;
  for (const auto& [from, to] : copies) {
    arrived.emplace_back(from->size());
    ROMAP_RETURN_IF_ERROR(CopyToHost(arrived.back().data(), from->data(), from->bytes(), stream));
  }
  Occupancy::State cells{
      .score = std::vector<float>(kCells), .bits = std::vector<uint32_t>(kCells / 32), .layer_weight = {}};
  std::vector<unsigned long long> layers(kLayers);
  ROMAP_RETURN_IF_ERROR(CopyToHost(cells.score.data(), score_.data(), score_.bytes(), stream));
  ROMAP_RETURN_IF_ERROR(CopyToHost(cells.bits.data(), occupied_bits_.data(), occupied_bits_.bytes(), stream));
  ROMAP_RETURN_IF_ERROR(CopyToHost(layers.data(), layer_weight_.data(), layer_weight_.bytes(), stream));
  ROMAP_RETURN_IF_ERROR(Synchronize(stream));
  for (size_t i = 0; i < arrived.size(); ++i) std::ranges::copy(arrived[i], copies[i].second);
  field.model.mlp.UpdateTransposed();
  for (size_t i = 0; i < layers.size(); ++i) {
    cells.layer_weight[i / kOccupancyResolution][i % kOccupancyResolution] =
        static_cast<double>(layers[i]) * kLayerUnit;
  }
  occupancy.SetState(cells);
  return absl::OkStatus();
}

}  // namespace romap::nerf::cuda
