#include "common/assignment.h"

#include <limits>

namespace romap {
namespace {

// Requires rows <= columns. Rows and columns are numbered from 1; index 0 of the arrays means "none".
std::vector<int> AssignWide(const Eigen::MatrixXd& cost) {
  const int rows = static_cast<int>(cost.rows());
  const int columns = static_cast<int>(cost.cols());
  std::vector<double> row_potential(rows + 1), column_potential(columns + 1);
  std::vector<int> row_of(columns + 1);  // the row assigned to a column
  for (int row = 1; row <= rows; ++row) {
    // Grows a tree of shortest alternating paths from `row` until it reaches a free column.
    std::vector<double> slack(columns + 1, std::numeric_limits<double>::infinity());
    std::vector<int> previous(columns + 1);
    std::vector<bool> visited(columns + 1);
    row_of[0] = row;
    int column = 0;
    while (row_of[column] != 0) {
      visited[column] = true;
      int next = 0;
      double step = std::numeric_limits<double>::infinity();
      for (int j = 1; j <= columns; ++j) {
        if (visited[j]) continue;
        const double reduced = cost(row_of[column] - 1, j - 1) - row_potential[row_of[column]] - column_potential[j];
        if (reduced < slack[j]) {
          slack[j] = reduced;
          previous[j] = column;
        }
        if (slack[j] < step) {
          step = slack[j];
          next = j;
        }
      }
      for (int j = 0; j <= columns; ++j) {
        if (visited[j]) {
          row_potential[row_of[j]] += step;
          column_potential[j] -= step;
        } else {
          slack[j] -= step;
        }
      }
      column = next;
    }
    for (; column != 0; column = previous[column]) row_of[column] = row_of[previous[column]];
  }
  std::vector<int> column_of(rows, -1);
  for (int j = 1; j <= columns; ++j) {
    if (row_of[j] != 0) column_of[row_of[j] - 1] = j - 1;
  }
  return column_of;
}

}  // namespace

std::vector<int> AssignRows(const Eigen::MatrixXd& cost) {
  if (cost.rows() <= cost.cols()) return AssignWide(cost);
  const std::vector<int> row_of = AssignWide(cost.transpose());
  std::vector<int> column_of(cost.rows(), -1);
  for (size_t column = 0; column < row_of.size(); ++column) column_of[row_of[column]] = static_cast<int>(column);
  return column_of;
}

}  // namespace romap
