#include <algorithm>
#include <memory>

#include "client/files/csv.h"
#include "client/files/text_file.h"
#include "client/files/tum.h"
#include "client/files/whole_number.h"
#include "client/files/yaml_value.h"
#include "client/importers/any_image.h"
#include "client/importers/folder.h"
#include "client/importers/frame_times.h"
#include "client/importers/matrix_pose.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

constexpr int64_t kMaxEurocPoseDistance_ns = 20'000'000;

// The calibration of a camera on its body.
struct EurocCamera {
  files::CameraYaml calibration;
  SE3<Camera, Camera> T_body_camera;
};

absl::StatusOr<EurocCamera> ReadEurocCamera(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const YAML::Node root, files::LoadYamlMap(path));
  EurocCamera result;
  CameraModel& camera = result.calibration.camera;
  const std::string model = files::YamlText(root, "camera_model", "pinhole");
  if (model != "pinhole") return InvalidArgument("{}: camera_model '{}'; expected pinhole", path, model);
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> size, files::YamlNumbers(root, "resolution", 2, path));
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> k, files::YamlNumbers(root, "intrinsics", 4, path));
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> d, files::YamlNumbers(root, "distortion_coefficients", 4, path));
  camera = {.width_px = files::SideOf_px(size[0]),
            .height_px = files::SideOf_px(size[1]),
            .fx_px = k[0],
            .fy_px = k[1],
            .cx_px = k[2],
            .cy_px = k[3],
            .distortion = {d[0], d[1], d[2], d[3], 0}};
  const std::string distortion = files::YamlText(root, "distortion_model", "");
  if (distortion == "equidistant") {
    camera.lens = LensModel::kFisheye;
  } else if (distortion != "radial-tangential" && distortion != "radtan") {
    return InvalidArgument("{}: distortion_model '{}'; expected radial-tangential or equidistant", path, distortion);
  }
  if (!root["T_BS"] || !root["T_BS"].IsMap()) {
    return InvalidArgument("{}: 'T_BS' is missing: the pose of the camera on the body", path);
  }
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> matrix, files::YamlNumbers(root["T_BS"], "data", 16, path));
  ROMAP_ASSIGN_OR_RETURN(const auto offset, PoseOfMatrix(matrix, path + ": T_BS"));
  if (!offset) return InvalidArgument("{}: T_BS is not finite", path);
  result.T_body_camera = {offset->rotation(), offset->translation()};
  return result;
}

// Rows of `time p_x p_y p_z q_w q_x q_y q_z ...`: the body in the world.
absl::StatusOr<std::vector<files::StampedPose>> ReadEurocPoses(const std::string& path,
                                                               const SE3<Camera, Camera>& T_body_camera) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<files::CsvRow> rows, files::ReadCsv(path));
  std::vector<files::StampedPose> poses;
  for (const files::CsvRow& row : rows) {
    const auto time_ns = row.fields.size() < 8 ? std::nullopt : files::ParseScaled(row.fields[0], 0);
    std::array<double, 7> x{};
    bool are_numbers = time_ns.has_value();
    for (size_t k = 0; are_numbers && k < x.size(); ++k) {
      const auto value = files::ParseNumber(row.fields[k + 1]);
      are_numbers = value.has_value();
      x[k] = value.value_or(0);
    }
    if (!are_numbers) return InvalidArgument("{}:{}: expected 'time,px,py,pz,qw,qx,qy,qz'", path, row.line);
    const Eigen::Quaterniond rotation(x[3], x[4], x[5], x[6]);
    if (std::abs(rotation.norm() - 1) > 0.05) {
      return InvalidArgument("{}:{}: quaternion norm is {:.3f}; expected 1", path, row.line, rotation.norm());
    }
    const SE3<World, Camera> T_world_body(rotation, Eigen::Vector3d(x[0], x[1], x[2]));
    poses.push_back({*time_ns, T_world_body * T_body_camera});
  }
  std::ranges::stable_sort(poses, {}, &files::StampedPose::timestamp_ns);
  return poses;
}

class EurocReader : public SequenceReader {
 public:
  std::string Name() const override { return "EuRoC MAV recording"; }
  std::string Expected() const override { return "mav0/cam0/data.csv and mav0/cam0/sensor.yaml"; }
  bool Fits(const std::string& source) const override { return Root(source).has_value(); }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions&) const override {
    const std::string root = *Root(source);
    RecordingContents contents{.source = source};
    ROMAP_ASSIGN_OR_RETURN(const EurocCamera camera, ReadEurocCamera(root + "/cam0/sensor.yaml"));
    contents.camera = camera.calibration;
    ROMAP_ASSIGN_OR_RETURN(const std::vector<files::CsvRow> rows, files::ReadCsv(root + "/cam0/data.csv"));
    for (const files::CsvRow& row : rows) {
      const auto time_ns = row.fields.size() < 2 ? std::nullopt : files::ParseScaled(row.fields[0], 0);
      if (!time_ns) {
        return InvalidArgument("{}/cam0/data.csv:{}: expected 'time in nanoseconds,file name'", root, row.line);
      }
      RecordedFrame& frame = contents.frames.emplace_back();
      frame.timestamp_ns = *time_ns;
      SetImage(root + "/cam0/data/" + row.fields[1], &frame);
    }
    SortByTime(&contents);
    SetRateByTimes(&contents);
    const auto truth = FirstExisting(root, {"state_groundtruth_estimate0/data.csv", "mocap0/data.csv"});
    if (!truth) return contents;
    ROMAP_ASSIGN_OR_RETURN(const std::vector<files::StampedPose> poses, ReadEurocPoses(*truth, camera.T_body_camera));
    for (RecordedFrame& frame : contents.frames) {
      frame.T_world_camera = files::PoseAt(poses, frame.timestamp_ns, kMaxEurocPoseDistance_ns);
    }
    return contents;
  }

 private:
  static std::optional<std::string> Root(const std::string& source) {
    for (const char* name : {"/mav0", ""}) {
      const std::string root = source + name;
      if (IsFile(root + "/cam0/data.csv") && IsFile(root + "/cam0/sensor.yaml")) return root;
    }
    return std::nullopt;
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeEurocReader() { return std::make_unique<EurocReader>(); }

}  // namespace romap::importers
