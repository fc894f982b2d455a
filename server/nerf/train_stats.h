#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <numeric>

namespace romap::nerf {

// Parts of an optimization step, for profiles.
enum class TrainPhase { kSampling, kEncode, kMlp, kRender, kMlpBackward, kEncodeBackward, kOptimize, kCount };
inline constexpr std::array<const char*, static_cast<int>(TrainPhase::kCount)> kTrainPhaseNames = {
    "sampling", "encode", "mlp", "render", "mlp back", "encode back", "optimize"};

// Statistics of one training run.
struct TrainStats {
  int steps = 0;
  uint64_t rays = 0;            // that intersected an occupied cell
  uint64_t samples = 0;         // evaluated
  uint64_t active_samples = 0;  // with a gradient large enough for the backward pass
  double color_loss = 0;        // mean squared color error per object ray
  double wall_s = 0;
  bool restarted = false;  // a parameter was not finite; training restarted
  std::array<double, static_cast<int>(TrainPhase::kCount)> phase_cpu_s = {};  // over all threads

  double evaluation_cpu_s = 0;  // between steps: comparing the field with the views, refining poses

  double StepCpuSeconds() const { return std::accumulate(phase_cpu_s.begin(), phase_cpu_s.end(), 0.0); }
  double CpuSeconds() const { return StepCpuSeconds() + evaluation_cpu_s; }
  // The cost of the run: CPU time, which does not depend on the load of the machine. Wall time on a device, whose steps
  // report no CPU time.
  double BusySeconds() const { return StepCpuSeconds() > 0 ? CpuSeconds() : wall_s; }

  // Adds the statistics of the run that followed this one. The loss becomes that of `next`.
  void Append(const TrainStats& next) {
    steps += next.steps;
    rays += next.rays;
    samples += next.samples;
    active_samples += next.active_samples;
    color_loss = next.color_loss;
    wall_s += next.wall_s;
    evaluation_cpu_s += next.evaluation_cpu_s;
    restarted |= next.restarted;
    for (size_t p = 0; p < phase_cpu_s.size(); ++p) phase_cpu_s[p] += next.phase_cpu_s[p];
  }
};

}  // namespace romap::nerf
