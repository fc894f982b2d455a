#pragma once

#include <array>
#include <cstdint>
#include <numeric>

namespace romap::nerf {

// Parts of an optimisation step, for profiles.
enum class TrainPhase { kSampling, kEncode, kMlp, kRender, kMlpBackward, kEncodeBackward, kOptimise, kCount };
inline constexpr std::array<const char*, static_cast<int>(TrainPhase::kCount)> kTrainPhaseNames = {
    "sampling", "encode", "mlp", "render", "mlp back", "encode back", "optimise"};

// What a call of Train did.
struct TrainStats {
  int steps = 0;
  uint64_t rays = 0;            // that met an occupied cell
  uint64_t samples = 0;         // evaluated
  uint64_t active_samples = 0;  // with a gradient worth the backward pass
  double color_loss = 0;        // mean squared colour error per object ray
  double wall_s = 0;
  bool restarted = false;  // a parameter was not finite; training began anew
  std::array<double, static_cast<int>(TrainPhase::kCount)> phase_cpu_s = {};  // over all threads

  double look_cpu_s = 0;  // between steps: how well views are met, where their cameras are

  double StepCpuSeconds() const { return std::accumulate(phase_cpu_s.begin(), phase_cpu_s.end(), 0.0); }
  double CpuSeconds() const { return StepCpuSeconds() + look_cpu_s; }
  // What it took of the machine: CPU time, which work of others beside it does not change; on a device, whose steps
  // tell no such time, wall time.
  double BusySeconds() const { return StepCpuSeconds() > 0 ? CpuSeconds() : wall_s; }
};

}  // namespace romap::nerf
