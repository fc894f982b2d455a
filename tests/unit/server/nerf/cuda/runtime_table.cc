// clang-format off
#ifndef ROMAP_TEST_ON_DEVICE
#include "tests/support/cuda_on_host/cuda_on_host.h"
#endif
// clang-format on
#include "tests/unit/server/nerf/cuda/runtime_table.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <memory>

#include "server/nerf/cpu/cpu_trainer.h"
#include "server/nerf/cuda/cuda_field.h"
#include "server/nerf/cuda/device_health.h"
#include "server/nerf/cuda/device_training.h"
#include "tests/unit/server/nerf/cuda/loaded_step.h"
#include "tests/unit/server/nerf/cuda/step_on_cpu.h"

namespace romap::nerf::cuda {
namespace {

// Rays at a ball, the same in every step, because the computation of rays on the host is not measured here.
StepSource BallSource(const NerfConfig& config) {
  auto rays = std::make_shared<std::vector<Ray>>(TestRays(config.rays_per_step, 8));
  for (Ray& ray : *rays) {
    float nearest = 0, distance = 0;
    for (int a = 0; a < 3; ++a) nearest += (0.5f - ray.origin[a]) * ray.direction[a];
    for (int a = 0; a < 3; ++a) distance += std::pow(ray.origin[a] + nearest * ray.direction[a] - 0.5f, 2.0f);
    ray.target.is_object = distance < 0.1f;
    ray.target.depth = -1;
  }
  StepSource source;
  source.ray = [rays](uint64_t, int index) { return (*rays)[static_cast<size_t>(index)]; };
  source.learning_rate = [](uint64_t) { return 0.01f; };
  return source;
}

// Milliseconds of the stream's work since the last call.
class StreamClock {
 public:
  explicit StreamClock(cudaStream_t stream) : stream_(stream) {
    cudaEventCreate(&begin_);
    cudaEventCreate(&end_);
    cudaEventRecord(begin_, stream_);
  }
  ~StreamClock() {
    cudaEventDestroy(begin_);
    cudaEventDestroy(end_);
  }
  absl::StatusOr<double> Milliseconds() {
    float ms = 0;
    cudaEventRecord(end_, stream_);
    ROMAP_RETURN_IF_ERROR(ToStatus(cudaEventSynchronize(end_), "measure"));
    ROMAP_RETURN_IF_ERROR(ToStatus(cudaEventElapsedTime(&ms, begin_, end_), "measure"));
    cudaEventRecord(begin_, stream_);
    return ms;
  }

 private:
  cudaStream_t stream_;
  cudaEvent_t begin_ = nullptr, end_ = nullptr;
};

absl::Status MeasureParts(const NerfConfig& config, const TrainingState& field, const StepSource& source, int steps,
                          cudaStream_t stream, RuntimeTable& table) {
  constexpr int kSteps = 16;  // of the rays of one upload
  ROMAP_ASSIGN_OR_RETURN(StepBuffers buffers, LoadStep(config, field, Occupancy(config), source, kSteps, stream));
  ROMAP_ASSIGN_OR_RETURN(const PinnedArray<Ray> rays, RaysOfSteps(config, source, kSteps));
  StreamClock clock(stream);
  ROMAP_RETURN_IF_ERROR(CopyToDevice(buffers.rays.data(), rays.data(), rays.bytes(), stream));
  ROMAP_ASSIGN_OR_RETURN(const double upload_ms, clock.Milliseconds());
  table.ray_upload_ms = upload_ms / kSteps;
  const StepLaunch& launch = buffers.launch();
  for (int i = 0; i < steps; ++i) {
    ROMAP_RETURN_IF_ERROR(ToStatus(LaunchGradients(launch.step, MlpPath::kTensorCores, stream), "measure"));
  }
  ROMAP_ASSIGN_OR_RETURN(const double gradients_ms, clock.Milliseconds());
  table.gradients_ms = gradients_ms / steps;
  for (int i = 0; i < steps; ++i) ROMAP_RETURN_IF_ERROR(ToStatus(LaunchOptimize(launch, stream), "measure"));
  ROMAP_ASSIGN_OR_RETURN(const double optimize_ms, clock.Milliseconds());
  table.optimize_ms = optimize_ms / steps;
  return absl::OkStatus();
}

float Share(int i, int side) { return static_cast<float>(i) / static_cast<float>(side); }

absl::StatusOr<double> MeasureEvaluation(const FieldModel& model, int side) {
  ROMAP_ASSIGN_OR_RETURN(const CudaField field, CudaField::Create(model));
  std::vector<float> x, y, z;
  for (int i = 0; i < side * side * side; ++i) {
    x.push_back(Share(i % side, side));
    y.push_back(Share(i / side % side, side));
    z.push_back(Share(i / (side * side), side));
  }
  ROMAP_RETURN_IF_ERROR(field.Evaluate(x, y, z).status());
  const auto start = std::chrono::steady_clock::now();
  ROMAP_RETURN_IF_ERROR(field.Evaluate(x, y, z).status());
  return 1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

absl::StatusOr<RuntimeTable> MeasureRuntime(const NerfConfig& config, const std::string& name, int steps,
                                            int mesh_side) {
  ROMAP_ASSIGN_OR_RETURN(const cudaStream_t stream, StreamOfThread());
  CpuTrainer host(config, 1, PlainKernels());
  Occupancy occupancy(config);
  const StepSource source = BallSource(config);
  ROMAP_ASSIGN_OR_RETURN(const std::unique_ptr<DeviceTraining> training,
                         DeviceTraining::Create(config, host.model(), MlpPath::kTensorCores, stream));
  ROMAP_RETURN_IF_ERROR(training->Upload(host.state(), occupancy, stream));
  TrainStats warm_up, stats;
  ROMAP_RETURN_IF_ERROR(training->Train(source, 0, steps, stream, warm_up));
  const auto start = std::chrono::steady_clock::now();
  ROMAP_RETURN_IF_ERROR(training->Train(source, static_cast<uint64_t>(steps), steps, stream, stats));
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  RuntimeTable table{.field = name, .rays = config.rays_per_step};
  table.samples = static_cast<double>(stats.samples - warm_up.samples) / steps;
  table.iteration_ms = 1e3 * seconds / steps;
  ROMAP_RETURN_IF_ERROR(MeasureParts(config, host.state(), source, steps, stream, table));
  ROMAP_ASSIGN_OR_RETURN(table.evaluate_ms, MeasureEvaluation(host.model(), mesh_side));
  return table;
}

std::string Markdown(const std::string& device, const std::vector<RuntimeTable>& tables) {
  std::string text = fmt::format("Runtime on {} (paper, Table 3: RTX 4090), ms\n\n| task | paper |", device);
  for (const RuntimeTable& t : tables) text += fmt::format(" {} |", t.field);
  text += "\n| --- | --- |";
  for (size_t i = 0; i < tables.size(); ++i) text += " --- |";
  const auto row = [&](const std::string& task, const std::string& paper, auto value) {
    text += fmt::format("\n| {} | {} |", task, paper);
    for (const RuntimeTable& t : tables) text += fmt::format(" {} |", value(t));
  };
  const auto ms = [](double value) { return fmt::format("{:.4f}", value); };
  row("rays per iteration", "4096", [](const RuntimeTable& t) { return std::to_string(t.rays); });
  row("samples per iteration", "131072", [](const RuntimeTable& t) { return fmt::format("{:.0f}", t.samples); });
  row("rays: sampling (paper), upload (ours)", "0.0932", [&](const RuntimeTable& t) { return ms(t.ray_upload_ms); });
  row("forward and volume rendering", "0.156", [](const RuntimeTable&) { return std::string("see next row"); });
  row("backward (ours with all of the forward pass: one kernel)", "0.455 with the optimizer",
      [&](const RuntimeTable& t) { return ms(t.gradients_ms); });
  row("optimizer and occupancy", "see previous row", [&](const RuntimeTable& t) { return ms(t.optimize_ms); });
  row("iteration", "0.706", [&](const RuntimeTable& t) { return ms(t.iteration_ms); });
  row("million samples trained per second", "186",
      [](const RuntimeTable& t) { return fmt::format("{:.1f}", t.MillionSamplesPerSecond()); });
  row("marching cubes (ours: evaluation at 64^3 nodes and both copies; the CPU makes the triangles)", "2.84",
      [&](const RuntimeTable& t) { return ms(t.evaluate_ms); });
  return text + "\n";
}

std::string DeviceName() {
  cudaDeviceProp properties;
  if (!DeviceStatus().ok() || cudaGetDeviceProperties(&properties, 0) != cudaSuccess) return "";
  return properties.name;
}

}  // namespace romap::nerf::cuda
