#pragma once

#include <Eigen/Core>
#include <vector>

namespace romap::objects {

// One-to-one assignment of rows to columns with the greatest sum of scores. Unlike with AssignRows() in
// common/assignment.h, which solves each connected component here, rows may stay unassigned: only pairs that score at
// least `min_score` are possible. Returns for each row its column, or -1.
std::vector<int> AssignByScore(const Eigen::MatrixXd& scores, double min_score);

}  // namespace romap::objects
