#pragma once

#include <Eigen/Core>
#include <vector>

namespace romap {

// One-to-one assignment of rows to columns with the least total cost (Hungarian method with potentials; Kuhn 1955,
// Munkres 1957), O(n^3). Returns for each row its column, or -1 for the rows left over when there are more rows than
// columns.
std::vector<int> AssignRows(const Eigen::MatrixXd& cost);

}  // namespace romap
