#pragma once

#include <Eigen/Core>
#include <vector>

namespace romap {

// One-to-one assignment of rows to columns with the least total cost (Hungarian method with potentials; Kuhn 1955,
// Munkres 1957), O(n^3). Returns the column of each row. If there are more rows than columns, the unassigned rows get
// -1.
std::vector<int> AssignRows(const Eigen::MatrixXd& cost);

}  // namespace romap
