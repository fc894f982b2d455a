#include <algorithm>
#include <cmath>
#include <memory>

#include "client/files/text_file.h"
#include "client/files/tum.h"
#include "client/files/whole_number.h"
#include "client/importers/any_image.h"
#include "client/importers/depth_image.h"
#include "client/importers/folder.h"
#include "client/importers/frame_times.h"
#include "client/importers/matrix_pose.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

// The times in the names of files that belong together differ by up to 1 ms.
constexpr int64_t kMaxNameDistance_ns = 1'500'000;
// The trajectory has 10 poses per second.
constexpr int64_t kMaxTrajectoryGap_ns = 300'000'000;
constexpr int kHighestArkitConfidence = 2;

struct StampedFile {
  int64_t timestamp_ns = 0;
  std::string path;
};

// Files called ID_SECONDS.EXTENSION, by time.
std::vector<StampedFile> FilesByTime(const std::string& folder, std::string_view extension) {
  std::vector<StampedFile> files;
  for (const std::string& name : FileNames(folder, extension)) {
    const std::string stem = StemOf(name);
    const auto time_ns = files::ParseSeconds(stem.substr(stem.find_last_of('_') + 1));
    if (time_ns) files.push_back({*time_ns, folder + "/" + name});
  }
  std::ranges::sort(files, {}, &StampedFile::timestamp_ns);
  return files;
}

// Empty: none within kMaxNameDistance_ns.
std::string Nearest(const std::vector<StampedFile>& files, int64_t timestamp_ns) {
  const auto after = std::ranges::lower_bound(files, timestamp_ns, {}, &StampedFile::timestamp_ns);
  const StampedFile* best = nullptr;
  for (auto it = after == files.begin() ? after : after - 1; it != files.end() && it <= after; ++it) {
    const int64_t distance_ns = std::abs(it->timestamp_ns - timestamp_ns);
    if (distance_ns > kMaxNameDistance_ns) continue;
    if (best == nullptr || distance_ns < std::abs(best->timestamp_ns - timestamp_ns)) best = &*it;
  }
  return best == nullptr ? "" : best->path;
}

// Lines of `time rx ry rz tx ty tz`: the rotation as axis times angle, world to camera.
absl::StatusOr<std::vector<files::StampedPose>> ReadTrajectory(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<files::TableLine> lines, files::ReadTable(path));
  std::vector<files::StampedPose> poses;
  for (const files::TableLine& line : lines) {
    std::vector<double> numbers;
    for (const std::string& field : line.fields) {
      if (const auto number = files::ParseNumber(field)) numbers.push_back(*number);
    }
    const auto time_ns = line.fields.empty() ? std::nullopt : files::ParseSeconds(line.fields[0]);
    if (numbers.size() != 7 || !time_ns) {
      return InvalidArgument("{}:{}: expected 'time rx ry rz tx ty tz'", path, line.number);
    }
    const Eigen::Vector3d axis(numbers[1], numbers[2], numbers[3]);
    const double angle = axis.norm();
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(
        angle, angle > 0 ? Eigen::Vector3d(axis / angle) : Eigen::Vector3d(Eigen::Vector3d::UnitX())));
    const SE3<Camera, World> T_camera_world(rotation, Eigen::Vector3d(numbers[4], numbers[5], numbers[6]));
    poses.push_back({*time_ns, T_camera_world.Inverse()});
  }
  std::ranges::stable_sort(poses, {}, &files::StampedPose::timestamp_ns);
  return poses;
}

// "width height fx fy cx cy"; the corner of the image is (0, 0).
absl::StatusOr<CameraModel> ReadPincam(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> p, ReadNumbers(path));
  if (p.size() != 6) return InvalidArgument("{}: expected 'width height fx fy cx cy'", path);
  return CameraModel{.width_px = files::SideOf_px(p[0]),
                     .height_px = files::SideOf_px(p[1]),
                     .fx_px = p[2],
                     .fy_px = p[3],
                     .cx_px = p[4] - 0.5,
                     .cy_px = p[5] - 0.5};
}

class ArkitScenesReader : public SequenceReader {
 public:
  std::string Name() const override { return "ARKitScenes recording"; }
  std::string Expected() const override { return "lowres_wide/*.png, lowres_wide_intrinsics/ and lowres_wide.traj"; }
  bool Fits(const std::string& source) const override {
    return !FileNames(source + "/lowres_wide", ".png").empty() && IsFolder(source + "/lowres_wide_intrinsics");
  }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions&) const override {
    RecordingContents contents{.source = source};
    const std::string cameras_folder = source + "/lowres_wide_intrinsics";
    const std::vector<StampedFile> cameras = FilesByTime(cameras_folder, ".pincam");
    const std::vector<StampedFile> depths = FilesByTime(source + "/lowres_depth", ".png");
    const std::vector<StampedFile> confidences = FilesByTime(source + "/confidence", ".png");
    std::vector<files::StampedPose> poses;
    if (const auto path = FirstExisting(source, {"lowres_wide.traj", "lowres_poses.traj"})) {
      ROMAP_ASSIGN_OR_RETURN(poses, ReadTrajectory(*path));
    }
    for (const StampedFile& image : FilesByTime(source + "/lowres_wide", ".png")) {
      const std::string pincam = Nearest(cameras, image.timestamp_ns);
      if (pincam.empty()) return NotFound("{}: no .pincam file within 1 ms of {}", cameras_folder, image.path);
      RecordedFrame& frame = contents.frames.emplace_back();
      frame.timestamp_ns = image.timestamp_ns;
      SetImage(image.path, &frame);
      ROMAP_ASSIGN_OR_RETURN(frame.camera, ReadPincam(pincam));
      frame.T_world_camera = PoseBetween(poses, image.timestamp_ns);
      const std::string depth = Nearest(depths, image.timestamp_ns);
      if (depth.empty()) continue;
      DepthRules rules{.confidence = Nearest(confidences, image.timestamp_ns),
                       .min_confidence = kHighestArkitConfidence};
      SetDepth(depth, rules, *frame.camera, &frame);
    }
    if (contents.frames.empty()) {
      return InvalidArgument("{}/lowres_wide: no file is called ID_SECONDS.png", source);
    }
    contents.camera.camera = *contents.frames.front().camera;
    contents.camera.depth_scale = 1e-3;
    SortByTime(&contents);
    SetRateByTimes(&contents);
    return contents;
  }

 private:
  // No pose before the first and after the last one.
  static std::optional<SE3<World, Camera>> PoseBetween(const std::vector<files::StampedPose>& poses,
                                                       int64_t timestamp_ns) {
    if (poses.empty() || timestamp_ns < poses.front().timestamp_ns - kMaxNameDistance_ns ||
        timestamp_ns > poses.back().timestamp_ns + kMaxNameDistance_ns) {
      return std::nullopt;
    }
    return files::PoseAt(poses, timestamp_ns, kMaxTrajectoryGap_ns / 2, kMaxTrajectoryGap_ns);
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeArkitScenesReader() { return std::make_unique<ArkitScenesReader>(); }

}  // namespace romap::importers
