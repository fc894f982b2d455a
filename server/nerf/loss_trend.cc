#include "server/nerf/loss_trend.h"

#include <algorithm>
#include <cmath>

namespace romap::nerf {

void LossTrend::Record(uint64_t step, double loss) {
  if (!(loss > 0) || !std::isfinite(loss)) return;
  measurements_[count_++ % kCapacity] = {static_cast<double>(step), std::log(loss)};
}

std::optional<double> LossTrend::DecreasePer100Steps() const {
  const size_t n = std::min(count_, kCapacity);
  if (n < 3) return std::nullopt;
  double mean_step = 0, mean_log = 0;
  for (size_t i = 0; i < n; ++i) {
    mean_step += measurements_[i].step / static_cast<double>(n);
    mean_log += measurements_[i].log_loss / static_cast<double>(n);
  }
  double variance = 0, covariance = 0;
  for (size_t i = 0; i < n; ++i) {
    variance += (measurements_[i].step - mean_step) * (measurements_[i].step - mean_step);
    covariance += (measurements_[i].step - mean_step) * (measurements_[i].log_loss - mean_log);
  }
  if (variance <= 0) return std::nullopt;
  return 1 - std::exp(100 * covariance / variance);
}

}  // namespace romap::nerf
