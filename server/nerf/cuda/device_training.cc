#include "server/nerf/cuda/device_training.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

namespace romap::nerf::cuda {
namespace {

absl::Status CopyToDevice(void* to, const void* from, size_t bytes, cudaStream_t stream) {
  return ToStatus(cudaMemcpyAsync(to, from, bytes, cudaMemcpyHostToDevice, stream), "copy to the device");
}
absl::Status CopyToHost(void* to, const void* from, size_t bytes, cudaStream_t stream) {
  return ToStatus(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, stream), "copy from the device");
}
template <class T>
absl::Status Zero(DeviceArray<T>& array, cudaStream_t stream) {
  return ToStatus(cudaMemsetAsync(array.data(), 0, array.bytes(), stream), "clear memory");
}
absl::Status Synchronise(cudaStream_t stream) { return ToStatus(cudaStreamSynchronize(stream), "train a field"); }

template <class Array>
absl::Status AllocateInto(Array& array, size_t count) {
  ROMAP_ASSIGN_OR_RETURN(array, Array::Allocate(count));
  return absl::OkStatus();
}

std::vector<uint32_t> PackBits(std::span<const uint8_t> cells) {
  std::vector<uint32_t> bits(cells.size() / 32);
  for (size_t i = 0; i < cells.size(); ++i) bits[i / 32] |= uint32_t{cells[i] != 0} << (i % 32);
  return bits;
}

// All rays of a step: rays[rays_per_step].
void FillRays(const StepSource& source, uint64_t step, std::span<Ray> rays) {
  for (size_t i = 0; i < rays.size(); ++i) rays[i] = source.ray(step, static_cast<int>(i));
}

SampleBudget MakeBudget(const NerfConfig& config) {
  return {.finest_step = static_cast<float>(config.min_sample_spacing),
          .least = std::min(config.min_samples_per_ray, config.max_samples_per_ray),
          .most = config.max_samples_per_ray,
          .skip_empty = config.sampling == "occupied"};
}

}  // namespace

absl::StatusOr<Stream> Stream::Create() {
  Stream stream;
  ROMAP_RETURN_IF_ERROR(ToStatus(cudaStreamCreateWithFlags(&stream.stream_, cudaStreamNonBlocking), "create a stream"));
  return stream;
}

absl::StatusOr<cudaStream_t> StreamOfThread() {
  thread_local std::optional<Stream> stream;
  if (!stream) {
    absl::StatusOr<Stream> created = Stream::Create();
    if (!created.ok()) return created.status();
    stream.emplace(std::move(created).value());
  }
  return stream->get();
}

absl::StatusOr<std::unique_ptr<DeviceTraining>> DeviceTraining::Create(const NerfConfig& config,
                                                                       const FieldModel& model, MlpPath path,
                                                                       cudaStream_t stream) {
  std::unique_ptr<DeviceTraining> training(new DeviceTraining);
  training->rays_per_step_ = config.rays_per_step;
  training->step_blocks_ = StepBlocks(config.rays_per_step, config.max_samples_per_ray);
  ROMAP_RETURN_IF_ERROR(training->Allocate(model));
  training->path_ = path;
  training->DescribeStep(config, model);
  ROMAP_RETURN_IF_ERROR(training->Capture(stream));
  return training;
}

DeviceTraining::~DeviceTraining() {
  for (Batch& batch : batches_) {
    if (batch.done != nullptr) cudaEventDestroy(batch.done);
  }
  if (graph_ != nullptr) cudaGraphExecDestroy(graph_);
}

absl::Status DeviceTraining::Allocate(const FieldModel& model) {
  const size_t table = model.table.size(), mlp = model.mlp.parameters.size();
  const size_t rays = static_cast<size_t>(kSteps) * static_cast<size_t>(rays_per_step_);
  for (DeviceArray<float>* array : {&table_, &table_first_, &table_second_, &table_gradient_}) {
    ROMAP_RETURN_IF_ERROR(AllocateInto(*array, table));
  }
  for (DeviceArray<float>* array : {&mlp_, &mlp_first_, &mlp_second_}) ROMAP_RETURN_IF_ERROR(AllocateInto(*array, mlp));
  ROMAP_RETURN_IF_ERROR(AllocateInto(mlp_partial_, mlp * static_cast<size_t>(step_blocks_)));
  ROMAP_RETURN_IF_ERROR(AllocateInto(rays_, rays));
  ROMAP_RETURN_IF_ERROR(AllocateInto(color_loss_, rays));
  ROMAP_RETURN_IF_ERROR(AllocateInto(learning_rate_, kSteps));
  ROMAP_RETURN_IF_ERROR(AllocateInto(slice_, 1));
  ROMAP_RETURN_IF_ERROR(AllocateInto(counters_, 1));
  ROMAP_RETURN_IF_ERROR(AllocateInto(score_, kCells));
  ROMAP_RETURN_IF_ERROR(AllocateInto(cell_visits_, kCells));
  ROMAP_RETURN_IF_ERROR(AllocateInto(cell_weight_, kCells));
  for (DeviceArray<uint32_t>* array : {&hull_bits_, &live_bits_, &occupied_bits_}) {
    ROMAP_RETURN_IF_ERROR(AllocateInto(*array, kCells / 32));
  }
  ROMAP_RETURN_IF_ERROR(AllocateInto(layer_weight_, kLayers));
  for (Batch& batch : batches_) {
    ROMAP_RETURN_IF_ERROR(AllocateInto(batch.rays, rays));
    ROMAP_RETURN_IF_ERROR(AllocateInto(batch.color_loss, rays));
    ROMAP_RETURN_IF_ERROR(AllocateInto(batch.learning_rate, kSteps));
    ROMAP_RETURN_IF_ERROR(AllocateInto(batch.slice, 1));
    ROMAP_RETURN_IF_ERROR(ToStatus(cudaEventCreate(&batch.done), "create an event"));
  }
  return absl::OkStatus();
}

void DeviceTraining::DescribeStep(const NerfConfig& config, const FieldModel& model) {
  launch_.step = {.field = {model.layout, table_.data(), mlp_.data(), model.mlp.hidden, model.density_bias},
                  .slice = slice_.data(),
                  .counters = counters_.data(),
                  .rays = rays_.data(),
                  .color_loss = color_loss_.data(),
                  .rays_per_step = rays_per_step_,
                  .budget = MakeBudget(config),
                  .loss_weights = MakeLossWeights(config),
                  .gradient_cut = static_cast<float>(config.min_sample_gradient),
                  .occupied_bits = occupied_bits_.data(),
                  .cell_visits = cell_visits_.data(),
                  .cell_weight = cell_weight_.data(),
                  .layer_weight = layer_weight_.data(),
                  .table_gradient = table_gradient_.data(),
                  .mlp_partial = mlp_partial_.data()};
  const OccupancyPlan plan{.start = static_cast<uint64_t>(config.occupancy_start_step),
                           .interval = static_cast<uint64_t>(config.occupancy_interval_steps)};
  launch_.optimise = {.slice = slice_.data(),
                      .learning_rate = learning_rate_.data(),
                      .beta1 = static_cast<float>(config.adam_beta1),
                      .beta2 = static_cast<float>(config.adam_beta2),
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
                      .step_blocks = step_blocks_,
                      .score = score_.data(),
                      .cell_visits = cell_visits_.data(),
                      .cell_weight = cell_weight_.data(),
                      .decay = static_cast<float>(config.occupancy_decay),
                      .threshold = static_cast<float>(config.occupancy_threshold),
                      .plan = plan,
                      .hull_bits = hull_bits_.data(),
                      .live_bits = live_bits_.data()};
  launch_.occupancy = {.slice = slice_.data(),
                       .plan = plan,
                       .live_bits = live_bits_.data(),
                       .hull_bits = hull_bits_.data(),
                       .occupied_bits = occupied_bits_.data(),
                       .layer_weight = layer_weight_.data()};
}

absl::Status DeviceTraining::Capture(cudaStream_t stream) {
  ROMAP_RETURN_IF_ERROR(ToStatus(PrepareStep(launch_.step, path_), "hold this field in a block's memory"));
  ROMAP_RETURN_IF_ERROR(
      ToStatus(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal), "capture a training step"));
  const cudaError_t launched = LaunchStep(launch_, path_, stream);
  cudaGraph_t graph = nullptr;
  const cudaError_t captured = cudaStreamEndCapture(stream, &graph);
  ROMAP_RETURN_IF_ERROR(ToStatus(launched != cudaSuccess ? launched : captured, "capture a training step"));
  const cudaError_t made = cudaGraphInstantiate(&graph_, graph, 0);
  cudaGraphDestroy(graph);
  return ToStatus(made, "capture a training step");
}

cudaError_t DeviceTraining::UploadRays(cudaStream_t stream) {
  return cudaMemcpyAsync(rays_.data(), batches_[0].rays.data(), rays_.bytes(), cudaMemcpyHostToDevice, stream);
}

cudaError_t DeviceTraining::LaunchOne(bool gradients, cudaStream_t stream) {
  if (const cudaError_t error = cudaMemsetAsync(&slice_.data()->next, 0, sizeof(SliceState::next), stream))
    return error;
  return gradients ? LaunchGradients(launch_.step, path_, stream) : LaunchOptimise(launch_, stream);
}

absl::Status DeviceTraining::Upload(const FieldTrainer::State& field, const Occupancy& occupancy, cudaStream_t stream) {
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
  ROMAP_RETURN_IF_ERROR(Zero(counters_, stream));
  return Synchronise(stream);  // the vectors above go
}

absl::Status DeviceTraining::Train(const StepSource& source, uint64_t first_step, int steps, cudaStream_t stream,
                                   TrainStats& stats) {
  double loss = 0;
  uint64_t rays_with_loss = 0;
  int begun = 0;
  for (int turn = 0; begun < steps; ++turn) {
    Batch& batch = batches_[turn % 2];
    ROMAP_RETURN_IF_ERROR(TakeIn(batch, loss, rays_with_loss));
    const int now = std::min(kSteps, steps - begun);
    ROMAP_RETURN_IF_ERROR(Launch(source, first_step + static_cast<uint64_t>(begun), now, batch, stream));
    begun += now;
  }
  StepCounters counters{};
  ROMAP_RETURN_IF_ERROR(CopyToHost(&counters, counters_.data(), sizeof(counters), stream));
  ROMAP_RETURN_IF_ERROR(Synchronise(stream));
  for (Batch& batch : batches_) ROMAP_RETURN_IF_ERROR(TakeIn(batch, loss, rays_with_loss));
  stats.steps += steps;
  stats.rays += counters.rays;
  stats.samples += counters.samples;
  stats.active_samples += counters.active_samples;
  stats.color_loss = loss / static_cast<double>(std::max<uint64_t>(1, rays_with_loss));
  return absl::OkStatus();
}

absl::Status DeviceTraining::Launch(const StepSource& source, uint64_t first_step, int steps, Batch& batch,
                                    cudaStream_t stream) {
  const size_t per_step = static_cast<size_t>(rays_per_step_), count = static_cast<size_t>(steps);
  for (size_t i = 0; i < count; ++i) {
    const uint64_t step = first_step + i;
    FillRays(source, step, {batch.rays.data() + i * per_step, per_step});
    batch.learning_rate.data()[i] = source.learning_rate(step);
  }
  SliceState& slice = *batch.slice.data();
  slice = {.next = 0, .running = 0, .first_step = first_step, .extent = {}, .grid = source.grid};
  std::ranges::copy(source.extent, slice.extent);
  ROMAP_RETURN_IF_ERROR(CopyToDevice(rays_.data(), batch.rays.data(), count * per_step * sizeof(Ray), stream));
  ROMAP_RETURN_IF_ERROR(CopyToDevice(learning_rate_.data(), batch.learning_rate.data(), count * sizeof(float), stream));
  ROMAP_RETURN_IF_ERROR(CopyToDevice(slice_.data(), batch.slice.data(), sizeof(SliceState), stream));
  for (int i = 0; i < steps; ++i) ROMAP_RETURN_IF_ERROR(ToStatus(cudaGraphLaunch(graph_, stream), "train a field"));
  ROMAP_RETURN_IF_ERROR(
      CopyToHost(batch.color_loss.data(), color_loss_.data(), count * per_step * sizeof(float), stream));
  batch.steps = steps;
  return ToStatus(cudaEventRecord(batch.done, stream), "train a field");
}

// Waits for what was asked of the device with this batch and adds up its losses.
absl::Status DeviceTraining::TakeIn(Batch& batch, double& loss, uint64_t& rays) const {
  if (batch.steps == 0) return absl::OkStatus();
  ROMAP_RETURN_IF_ERROR(ToStatus(cudaEventSynchronize(batch.done), "train a field"));
  const size_t count = static_cast<size_t>(batch.steps) * static_cast<size_t>(rays_per_step_);
  for (const float color_loss : std::span(batch.color_loss.data(), count)) {
    if (color_loss < 0) continue;
    loss += color_loss;
    ++rays;
  }
  batch.steps = 0;
  return absl::OkStatus();
}

absl::Status DeviceTraining::Download(FieldTrainer::State field, Occupancy& occupancy, cudaStream_t stream) {
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
  ROMAP_RETURN_IF_ERROR(Synchronise(stream));
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
