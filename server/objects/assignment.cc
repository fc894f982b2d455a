#include "server/objects/assignment.h"

#include "common/assignment.h"

namespace romap {

std::vector<int> AssignMaximal(const Eigen::MatrixXd& scores, double min_score) {
  const Eigen::Index rows = scores.rows();
  const Eigen::Index columns = scores.cols();
  // A joined pair costs -score, staying alone costs nothing, so padding with zeros lets any row or column stay alone.
  Eigen::MatrixXd cost = Eigen::MatrixXd::Zero(rows + columns, rows + columns);
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j < columns; ++j) {
      if (scores(i, j) >= min_score) cost(i, j) = -scores(i, j);
    }
  }
  std::vector<int> column_of = AssignRows(cost);
  column_of.resize(static_cast<size_t>(rows));
  for (Eigen::Index i = 0; i < rows; ++i) {
    int& column = column_of[static_cast<size_t>(i)];
    if (column >= columns || !(scores(i, column) >= min_score)) column = -1;
  }
  return column_of;
}

}  // namespace romap
