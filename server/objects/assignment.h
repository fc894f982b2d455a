#pragma once

#include <Eigen/Core>
#include <vector>

namespace romap::objects {

// The one-to-one assignment of rows to columns with the greatest sum of scores, where only pairs whose score is at
// least `min_score` may be joined. Returns for each row its column, or -1.
std::vector<int> AssignMaximal(const Eigen::MatrixXd& scores, double min_score);

}  // namespace romap::objects
