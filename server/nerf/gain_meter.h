#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace romap::nerf {

// How fast a loss still falls. The losses are taken at the same places again and again (FieldProbe), so the slope of
// their logarithm over the last few looks is told from noise after few steps.
class GainMeter {
 public:
  // What is measured, or where, is something else from now on.
  void Restart() { count_ = 0; }
  // `loss` > 0 after `step` steps; steps only grow. One that is no number is left out.
  void Record(uint64_t step, double loss);
  // Share of the loss that 100 steps take away at present: the least-squares slope over the last looks; negative when
  // it grows. Nothing before there are three looks.
  std::optional<double> FallPer100Steps() const;

 private:
  static constexpr size_t kLooks = 4;
  struct Look {
    double step, log_loss;
  };
  std::array<Look, kLooks> looks_;  // a ring
  size_t count_ = 0;                // ever recorded
};

}  // namespace romap::nerf
