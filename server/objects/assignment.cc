#include "server/objects/assignment.h"

#include <limits>

namespace romap {
namespace {

// Minimum-cost perfect matching of a square matrix; returns for each row its column. Row and column 0 of the internal
// arrays are sentinels: column 0 holds the row that is being inserted.
std::vector<int> SolveSquare(const Eigen::MatrixXd& cost) {
  const auto n = static_cast<size_t>(cost.rows());
  std::vector<double> row_potential(n + 1, 0);
  std::vector<double> column_potential(n + 1, 0);
  std::vector<size_t> row_of(n + 1, 0);
  std::vector<size_t> previous(n + 1, 0);
  for (size_t row = 1; row <= n; ++row) {
    row_of[0] = row;
    size_t column = 0;
    std::vector<double> slack(n + 1, std::numeric_limits<double>::infinity());
    std::vector<char> visited(n + 1, 0);
    do {
      visited[column] = 1;
      const size_t current_row = row_of[column];
      double step = std::numeric_limits<double>::infinity();
      size_t next = 0;
      for (size_t j = 1; j <= n; ++j) {
        if (visited[j]) continue;
        const double reduced = cost(static_cast<Eigen::Index>(current_row - 1), static_cast<Eigen::Index>(j - 1)) -
                               row_potential[current_row] - column_potential[j];
        if (reduced < slack[j]) {
          slack[j] = reduced;
          previous[j] = column;
        }
        if (slack[j] < step) {
          step = slack[j];
          next = j;
        }
      }
      for (size_t j = 0; j <= n; ++j) {
        if (visited[j]) {
          row_potential[row_of[j]] += step;
          column_potential[j] -= step;
        } else {
          slack[j] -= step;
        }
      }
      column = next;
    } while (row_of[column] != 0);
    for (; column != 0; column = previous[column]) row_of[column] = row_of[previous[column]];
  }
  std::vector<int> column_of(n, -1);
  for (size_t j = 1; j <= n; ++j) column_of[row_of[j] - 1] = static_cast<int>(j - 1);
  return column_of;
}

}  // namespace

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
  std::vector<int> column_of = SolveSquare(cost);
  column_of.resize(static_cast<size_t>(rows));
  for (Eigen::Index i = 0; i < rows; ++i) {
    int& column = column_of[static_cast<size_t>(i)];
    if (column >= columns || !(scores(i, column) >= min_score)) column = -1;
  }
  return column_of;
}

}  // namespace romap
