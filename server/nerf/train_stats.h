#pragma once

#include <array>
#include <cstdint>

namespace romap {

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

  double CpuSeconds() const {
    double sum = 0;
    for (double s : phase_cpu_s) sum += s;
    return sum;
  }
  // What it took of the machine: CPU time, which work of others beside it does not change; on a device, which tells
  // no such time, wall time.
  double BusySeconds() const { return CpuSeconds() > 0 ? CpuSeconds() : wall_s; }
};

}  // namespace romap
