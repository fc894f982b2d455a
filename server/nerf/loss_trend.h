#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace romap::nerf {

// Estimates how fast a loss decreases: the slope of its logarithm over the last few measurements. The losses must be
// measured on the same pixels every time (FieldProbe); then a few measurements suffice.
class LossTrend {
 public:
  // Discards all measurements, because the pixels or the field changed.
  void Restart() { count_ = 0; }
  // Records the `loss` after `step` steps; `step` must increase. Ignored if the loss is not positive and finite.
  void Record(uint64_t step, double loss);
  // The relative decrease of the loss per 100 steps, by least squares over the last measurements; negative if the loss
  // increases. No value before there are three measurements.
  std::optional<double> DecreasePer100Steps() const;

 private:
  static constexpr size_t kCapacity = 4;
  struct Measurement {
    double step, log_loss;
  };
  std::array<Measurement, kCapacity> measurements_;  // a ring
  size_t count_ = 0;                                 // recorded since Restart(), may exceed the capacity
};

}  // namespace romap::nerf
