#pragma once

#include <Eigen/Core>
#include <string>

namespace romap::cli {

// The number of decimals that shows lengths up to `largest` with four significant digits: 3 for meters, 6 for
// kilometers, 0 for millimeters of objects with a size of a few meters.
int DecimalsFor(double largest);

// "x y z" with the separator in between.
std::string FormatVector(const Eigen::Vector3d& vector, const char* separator, int decimals);

}  // namespace romap::cli
