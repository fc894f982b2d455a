#include "server/nerf/gain_meter.h"

#include <algorithm>
#include <cmath>

namespace romap::nerf {

void GainMeter::Record(uint64_t step, double loss) {
  if (!(loss > 0) || !std::isfinite(loss)) return;
  looks_[count_++ % kLooks] = {static_cast<double>(step), std::log(loss)};
}

std::optional<double> GainMeter::FallPer100Steps() const {
  const size_t n = std::min(count_, kLooks);
  if (n < 3) return std::nullopt;
  double mean_step = 0, mean_log = 0;
  for (size_t i = 0; i < n; ++i) {
    mean_step += looks_[i].step / static_cast<double>(n);
    mean_log += looks_[i].log_loss / static_cast<double>(n);
  }
  double variance = 0, covariance = 0;
  for (size_t i = 0; i < n; ++i) {
    variance += (looks_[i].step - mean_step) * (looks_[i].step - mean_step);
    covariance += (looks_[i].step - mean_step) * (looks_[i].log_loss - mean_log);
  }
  if (variance <= 0) return std::nullopt;
  return 1 - std::exp(100 * covariance / variance);
}

}  // namespace romap::nerf
