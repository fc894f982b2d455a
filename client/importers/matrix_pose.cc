#include "client/importers/matrix_pose.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "client/files/pose_convention.h"
#include "client/files/text_file.h"

namespace romap::importers {
namespace {

constexpr double kMaxRotationError = 0.01;

std::optional<double> ParseAnyNumber(const std::string& text) {
  if (const auto number = files::ParseNumber(text)) return number;
  const bool is_negative = text.starts_with('-');
  const std::string word = is_negative || text.starts_with('+') ? text.substr(1) : text;
  if (word == "nan" || word == "NaN") return std::numeric_limits<double>::quiet_NaN();
  if (word != "inf" && word != "Inf" && word != "Infinity" && !word.starts_with("1.#INF")) return std::nullopt;
  return is_negative ? -std::numeric_limits<double>::infinity() : std::numeric_limits<double>::infinity();
}

}  // namespace

absl::StatusOr<std::optional<SE3<World, Camera>>> PoseOfMatrix(std::span<const double> matrix,
                                                               const std::string& where) {
  if (matrix.size() != 16 && matrix.size() != 12) {
    return InvalidArgument("{}: {} numbers; expected a row-major 4x4 matrix", where, matrix.size());
  }
  for (const double value : matrix) {
    if (!std::isfinite(value)) return std::optional<SE3<World, Camera>>();
  }
  using RowMajor = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;
  const RowMajor pose = Eigen::Map<const RowMajor>(matrix.data());
  const Eigen::Matrix3d rotation = pose.leftCols<3>();
  const double error = (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (error > kMaxRotationError || rotation.determinant() < 0) {
    return InvalidArgument("{}: the first three columns are no rotation ({}); expected a rigid transform", where,
                           rotation.determinant() < 0 ? "they mirror" : "they are not orthonormal");
  }
  return std::optional(SE3<World, Camera>(rotation, Eigen::Vector3d(pose.col(3))));
}

absl::StatusOr<std::vector<std::vector<double>>> ReadNumberLines(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<files::TableLine> table, files::ReadTable(path));
  std::vector<std::vector<double>> lines;
  for (const files::TableLine& line : table) {
    std::vector<double>& numbers = lines.emplace_back();
    for (const std::string& field : line.fields) {
      const std::optional<double> number = ParseAnyNumber(field);
      if (!number) return InvalidArgument("{}:{}: '{}' is not a number", path, line.number, field);
      numbers.push_back(*number);
    }
  }
  return lines;
}

absl::StatusOr<std::vector<double>> ReadNumbers(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<std::vector<double>> lines, ReadNumberLines(path));
  std::vector<double> all;
  for (const std::vector<double>& line : lines) all.insert(all.end(), line.begin(), line.end());
  return all;
}

absl::StatusOr<std::optional<SE3<World, Camera>>> PoseOfLine(const std::vector<std::vector<double>>& lines, size_t line,
                                                             const std::string& path) {
  if (line >= lines.size()) return std::optional<SE3<World, Camera>>();
  return PoseOfMatrix(lines[line], fmt::format("{}:{}", path, line + 1));
}

absl::StatusOr<std::optional<SE3<World, Camera>>> ReadMatrixPose(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> numbers, ReadNumbers(path));
  return PoseOfMatrix(numbers, path);
}

SE3<World, Camera> FromOpenGl(const SE3<World, Camera>& pose) { return files::ApplyConvention({.opengl = true}, pose); }

SE3<World, Camera> FromWorldToCamera(const SE3<World, Camera>& pose) {
  return files::ApplyConvention({.world_to_camera = true}, pose);
}

}  // namespace romap::importers
