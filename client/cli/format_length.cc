#include "client/cli/format_length.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace romap::cli {

int DecimalsFor(double largest) {
  constexpr int kDefault = 3;
  constexpr int kMost = 15;
  if (!(largest > 0) || !std::isfinite(largest)) return kDefault;
  return std::clamp(kDefault - static_cast<int>(std::floor(std::log10(largest))), 0, kMost);
}

std::string FormatVector(const Eigen::Vector3d& vector, const char* separator, int decimals) {
  return fmt::format("{:.{}f}{}{:.{}f}{}{:.{}f}", vector.x(), decimals, separator, vector.y(), decimals, separator,
                     vector.z(), decimals);
}

}  // namespace romap::cli
