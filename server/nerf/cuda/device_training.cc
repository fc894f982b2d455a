#include "server/nerf/cuda/device_training.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

namespace romap::nerf::cuda {
namespace {

constexpr int kSteps = 16;  // per upload of rays

// Owns a CUDA stream.
class Stream {
 public:
  static absl::StatusOr<Stream> Create() {
    Stream stream;
    ROMAP_RETURN_IF_ERROR(
        ToStatus(cudaStreamCreateWithFlags(&stream.stream_, cudaStreamNonBlocking), "create a stream"));
    return stream;
  }
  Stream(Stream&& other) noexcept : stream_(std::exchange(other.stream_, nullptr)) {}
  ~Stream() {
    if (stream_ != nullptr) cudaStreamDestroy(stream_);
  }
  cudaStream_t get() const { return stream_; }

 private:
  Stream() = default;
  cudaStream_t stream_ = nullptr;
};

template <class Array>
absl::Status AllocateInto(Array& array, size_t count) {
  ROMAP_ASSIGN_OR_RETURN(array, Array::Allocate(count));
  return absl::OkStatus();
}

// All rays of a step: rays[rays_per_step].
void FillRays(const StepSource& source, uint64_t step, std::span<Ray> rays) {
  for (size_t i = 0; i < rays.size(); ++i) rays[i] = source.ray(step, static_cast<int>(i));
}

}  // namespace

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
  ROMAP_ASSIGN_OR_RETURN(StepBuffers buffers, StepBuffers::Create(config, model, kSteps));
  std::unique_ptr<DeviceTraining> training(new DeviceTraining(std::move(buffers)));
  training->path_ = path;
  training->rays_per_step_ = config.rays_per_step;
  ROMAP_RETURN_IF_ERROR(training->AllocateBatches());
  ROMAP_RETURN_IF_ERROR(training->Capture(stream));
  return training;
}

DeviceTraining::~DeviceTraining() {
  for (Batch& batch : batches_) {
    if (batch.done != nullptr) cudaEventDestroy(batch.done);
  }
  if (graph_ != nullptr) cudaGraphExecDestroy(graph_);
}

absl::Status DeviceTraining::AllocateBatches() {
  const size_t rays = static_cast<size_t>(kSteps) * static_cast<size_t>(rays_per_step_);
  for (Batch& batch : batches_) {
    ROMAP_RETURN_IF_ERROR(AllocateInto(batch.rays, rays));
    ROMAP_RETURN_IF_ERROR(AllocateInto(batch.color_loss, rays));
    ROMAP_RETURN_IF_ERROR(AllocateInto(batch.learning_rate, kSteps));
    ROMAP_RETURN_IF_ERROR(AllocateInto(batch.slice, 1));
    ROMAP_RETURN_IF_ERROR(ToStatus(cudaEventCreate(&batch.done), "create an event"));
  }
  return absl::OkStatus();
}

absl::Status DeviceTraining::Capture(cudaStream_t stream) {
  ROMAP_RETURN_IF_ERROR(ToStatus(PrepareStep(buffers_.launch().step, path_), "reserve the shared memory of a block"));
  ROMAP_RETURN_IF_ERROR(
      ToStatus(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal), "capture a training step"));
  const cudaError_t launched = LaunchStep(buffers_.launch(), path_, stream);
  cudaGraph_t graph = nullptr;
  const cudaError_t captured = cudaStreamEndCapture(stream, &graph);
  ROMAP_RETURN_IF_ERROR(ToStatus(launched != cudaSuccess ? launched : captured, "capture a training step"));
  const cudaError_t made = cudaGraphInstantiate(&graph_, graph, 0);
  cudaGraphDestroy(graph);
  return ToStatus(made, "capture a training step");
}

absl::Status DeviceTraining::Train(const StepSource& source, uint64_t first_step, int steps, cudaStream_t stream,
                                   TrainStats& stats) {
  double loss = 0;
  uint64_t rays_with_loss = 0;
  int started = 0;
  for (int turn = 0; started < steps; ++turn) {
    Batch& batch = batches_[turn % 2];
    ROMAP_RETURN_IF_ERROR(CollectLosses(batch, loss, rays_with_loss));
    const int now = std::min(kSteps, steps - started);
    ROMAP_RETURN_IF_ERROR(Launch(source, first_step + static_cast<uint64_t>(started), now, batch, stream));
    started += now;
  }
  StepCounters counters{};
  ROMAP_RETURN_IF_ERROR(CopyToHost(&counters, buffers_.counters.data(), sizeof(counters), stream));
  ROMAP_RETURN_IF_ERROR(Synchronize(stream));
  for (Batch& batch : batches_) ROMAP_RETURN_IF_ERROR(CollectLosses(batch, loss, rays_with_loss));
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
  ROMAP_RETURN_IF_ERROR(CopyToDevice(buffers_.rays.data(), batch.rays.data(), count * per_step * sizeof(Ray), stream));
  ROMAP_RETURN_IF_ERROR(
      CopyToDevice(buffers_.learning_rate.data(), batch.learning_rate.data(), count * sizeof(float), stream));
  ROMAP_RETURN_IF_ERROR(CopyToDevice(buffers_.slice.data(), batch.slice.data(), sizeof(SliceState), stream));
  for (int i = 0; i < steps; ++i) ROMAP_RETURN_IF_ERROR(ToStatus(cudaGraphLaunch(graph_, stream), "train a field"));
  ROMAP_RETURN_IF_ERROR(
      CopyToHost(batch.color_loss.data(), buffers_.color_loss.data(), count * per_step * sizeof(float), stream));
  batch.steps = steps;
  return ToStatus(cudaEventRecord(batch.done, stream), "train a field");
}

// Waits until the device has finished the batch, then adds its losses to the sums.
absl::Status DeviceTraining::CollectLosses(Batch& batch, double& loss, uint64_t& rays) const {
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

}  // namespace romap::nerf::cuda
