#include "server/objects/score_assignment.h"

#include "common/assignment.h"

namespace romap::objects {
namespace {

// Rows and columns connected by possible pairs.
struct Component {
  std::vector<Eigen::Index> rows;
  std::vector<Eigen::Index> columns;
};

std::vector<Component> FindComponents(const Eigen::MatrixXd& scores, double min_score) {
  std::vector<bool> column_seen(static_cast<size_t>(scores.cols()), false);
  std::vector<bool> row_seen(static_cast<size_t>(scores.rows()), false);
  std::vector<Component> components;
  for (Eigen::Index start = 0; start < scores.rows(); ++start) {
    if (row_seen[static_cast<size_t>(start)]) continue;
    row_seen[static_cast<size_t>(start)] = true;
    Component component{.rows = {start}, .columns = {}};
    size_t next_column = 0;
    for (size_t next_row = 0; next_row < component.rows.size(); ++next_row) {
      for (Eigen::Index j = 0; j < scores.cols(); ++j) {
        if (column_seen[static_cast<size_t>(j)] || !(scores(component.rows[next_row], j) >= min_score)) continue;
        column_seen[static_cast<size_t>(j)] = true;
        component.columns.push_back(j);
      }
      for (; next_column < component.columns.size(); ++next_column) {
        for (Eigen::Index i = 0; i < scores.rows(); ++i) {
          if (row_seen[static_cast<size_t>(i)] || !(scores(i, component.columns[next_column]) >= min_score)) continue;
          row_seen[static_cast<size_t>(i)] = true;
          component.rows.push_back(i);
        }
      }
    }
    if (!component.columns.empty()) components.push_back(std::move(component));
  }
  return components;
}

}  // namespace

std::vector<int> AssignByScore(const Eigen::MatrixXd& scores, double min_score) {
  std::vector<int> column_of(static_cast<size_t>(scores.rows()), -1);
  // Each component is solved separately, because the time of an assignment grows with the third power of its size.
  for (const Component& component : FindComponents(scores, min_score)) {
    const auto rows = static_cast<Eigen::Index>(component.rows.size());
    const auto columns = static_cast<Eigen::Index>(component.columns.size());
    // A pair costs -score. Zero cost in the padding lets every row and column stay unassigned.
    Eigen::MatrixXd cost = Eigen::MatrixXd::Zero(rows + columns, rows + columns);
    for (Eigen::Index i = 0; i < rows; ++i) {
      for (Eigen::Index j = 0; j < columns; ++j) {
        const double score = scores(component.rows[static_cast<size_t>(i)], component.columns[static_cast<size_t>(j)]);
        if (score >= min_score) cost(i, j) = -score;
      }
    }
    const std::vector<int> assigned = AssignRows(cost);
    for (Eigen::Index i = 0; i < rows; ++i) {
      const int j = assigned[static_cast<size_t>(i)];
      if (j < 0 || j >= columns || !(cost(i, j) < 0)) continue;
      column_of[static_cast<size_t>(component.rows[static_cast<size_t>(i)])] =
          static_cast<int>(component.columns[static_cast<size_t>(j)]);
    }
  }
  return column_of;
}

}  // namespace romap::objects
