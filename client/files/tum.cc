#include "client/files/tum.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "client/files/text_file.h"

namespace romap::files {
namespace {

absl::StatusOr<StampedPose> ParsePose(const TableLine& line, TimeUnit unit, const std::string& path) {
  if (line.fields.size() != 8) {
    return InvalidArgument("{}:{}: {} fields; expected 8 (t tx ty tz qx qy qz qw)", path, line.number,
                           line.fields.size());
  }
  const std::optional<int64_t> timestamp_ns = ParseTimestamp(line.fields[0], unit);
  std::array<double, 8> x{};
  for (size_t k = 0; k < x.size(); ++k) {
    const std::optional<double> value = ParseNumber(line.fields[k]);
    if (!value || !timestamp_ns) {
      return InvalidArgument("{}:{}: '{}' is not a finite number", path, line.number, line.fields[value ? 0 : k]);
    }
    x[k] = *value;
  }
  const Eigen::Quaterniond rotation(x[7], x[4], x[5], x[6]);
  if (std::abs(rotation.norm() - 1) > 0.05) {
    return InvalidArgument("{}:{}: quaternion norm is {:.3f}; expected 1", path, line.number, rotation.norm());
  }
  return StampedPose{*timestamp_ns, {rotation, Eigen::Vector3d(x[1], x[2], x[3])}};
}

SE3<World, Camera> Interpolate(const StampedPose& before, const StampedPose& after, int64_t timestamp_ns) {
  const double fraction = static_cast<double>(timestamp_ns - before.timestamp_ns) /
                          static_cast<double>(after.timestamp_ns - before.timestamp_ns);
  const SE3<World, Camera>& a = before.T_world_camera;
  const SE3<World, Camera>& b = after.T_world_camera;
  return {a.rotation().slerp(fraction, b.rotation()),
          Eigen::Vector3d((1 - fraction) * a.translation() + fraction * b.translation())};
}

}  // namespace

absl::StatusOr<std::vector<StampedPose>> ReadTum(const std::string& path, TimeUnit* unit) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<TableLine> lines, ReadTable(path));
  std::vector<std::string> timestamps;
  for (const TableLine& line : lines) timestamps.push_back(line.fields[0]);
  const TimeUnit detected = DetectTimeUnit(timestamps);
  if (unit != nullptr) *unit = detected;
  std::vector<StampedPose> poses;
  poses.reserve(lines.size());
  for (const TableLine& line : lines) {
    ROMAP_ASSIGN_OR_RETURN(StampedPose pose, ParsePose(line, detected, path));
    poses.push_back(pose);
  }
  if (poses.empty()) return InvalidArgument("{}: the file contains no poses", path);
  std::stable_sort(poses.begin(), poses.end(),
                   [](const StampedPose& a, const StampedPose& b) { return a.timestamp_ns < b.timestamp_ns; });
  return poses;
}

absl::Status WriteTum(const std::string& path, std::span<const StampedPose> poses) {
  std::string text = "# timestamp tx ty tz qx qy qz qw (seconds; camera to world, x right, y down, z forward)\n";
  for (const StampedPose& pose : poses) {
    const Eigen::Vector3d& t = pose.T_world_camera.translation();
    const Eigen::Quaterniond& q = pose.T_world_camera.rotation();
    text += fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", FormatSeconds(pose.timestamp_ns),
                        t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  return WriteFile(path, text);
}

std::optional<SE3<World, Camera>> PoseAt(std::span<const StampedPose> poses, int64_t timestamp_ns, int64_t max_dt_ns,
                                         int64_t max_gap_ns) {
  const auto after = std::lower_bound(poses.begin(), poses.end(), timestamp_ns,
                                      [](const StampedPose& pose, int64_t t_ns) { return pose.timestamp_ns < t_ns; });
  const auto distance_ns = [&](auto it) { return std::abs(it->timestamp_ns - timestamp_ns); };
  if (after != poses.end() && after->timestamp_ns == timestamp_ns) return after->T_world_camera;
  if (after == poses.end() || after == poses.begin()) {
    if (poses.empty()) return std::nullopt;
    const auto nearest = after == poses.end() ? after - 1 : after;
    return distance_ns(nearest) <= max_dt_ns ? std::optional(nearest->T_world_camera) : std::nullopt;
  }
  const auto before = after - 1;
  const auto nearest = distance_ns(before) <= distance_ns(after) ? before : after;
  if (distance_ns(nearest) > max_dt_ns) return std::nullopt;
  if (after->timestamp_ns - before->timestamp_ns > max_gap_ns) return nearest->T_world_camera;
  return Interpolate(*before, *after, timestamp_ns);
}

}  // namespace romap::files
