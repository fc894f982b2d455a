#include <memory>

#include "client/importers/any_image.h"
#include "client/importers/depth_image.h"
#include "client/importers/folder.h"
#include "client/importers/frame_times.h"
#include "client/importers/json_file.h"
#include "client/importers/matrix_pose.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

// cam_params.json lies beside the scenes.
std::optional<std::string> FindCameraParameters(const std::string& source) {
  return FirstExisting(source, {"cam_params.json", "../cam_params.json"});
}

absl::Status ReadCameraParameters(const std::string& path, files::CameraYaml* calibration) {
  ROMAP_ASSIGN_OR_RETURN(const nlohmann::json root, LoadJson(path));
  if (!root.contains("camera")) return InvalidArgument("{}: 'camera' is missing", path);
  const nlohmann::json& values = root["camera"];
  ROMAP_ASSIGN_OR_RETURN(calibration->camera, JsonCamera(values, "w", "h", path));
  ROMAP_ASSIGN_OR_RETURN(const double scale, JsonNumber(values, "scale", path));
  if (scale <= 0) return InvalidArgument("{}: 'scale' is {}; expected depth units per meter", path, scale);
  calibration->depth_scale = 1 / scale;
  return absl::OkStatus();
}

class ReplicaReader : public SequenceReader {
 public:
  std::string Name() const override { return "Replica scene of NICE-SLAM"; }
  std::string Expected() const override { return "results/frame000000.jpg and traj.txt"; }
  bool Fits(const std::string& source) const override {
    return IsFile(source + "/traj.txt") && !ImageNames(source).empty();
  }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions& options) const override {
    RecordingContents contents{.source = source};
    const std::optional<std::string> parameters = FindCameraParameters(source);
    if (!parameters) return NotFound("{}/cam_params.json does not exist, nor in the folder above", source);
    ROMAP_RETURN_IF_ERROR(ReadCameraParameters(*parameters, &contents.camera));
    const std::string trajectory = source + "/traj.txt";
    ROMAP_ASSIGN_OR_RETURN(const std::vector<std::vector<double>> lines, ReadNumberLines(trajectory));
    for (const std::string& name : ImageNames(source)) {
      RecordedFrame& frame = contents.frames.emplace_back();
      SetImage(source + "/results/" + name, &frame);
      const std::string number = StemOf(name).substr(5);
      if (const std::string depth = source + "/results/depth" + number + ".png"; IsFile(depth)) {
        SetDepth(depth, {}, contents.camera.camera, &frame);
      }
      const auto line = static_cast<size_t>(LastNumber(number).value_or(static_cast<int64_t>(lines.size())));
      ROMAP_ASSIGN_OR_RETURN(frame.T_world_camera, PoseOfLine(lines, line, trajectory));
    }
    SetTimesByRate(options, &contents);
    return contents;
  }

 private:
  static std::vector<std::string> ImageNames(const std::string& source) {
    std::vector<std::string> names = FileNames(source + "/results");
    std::erase_if(names, [](const std::string& name) { return !name.starts_with("frame"); });
    return names;
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeReplicaReader() { return std::make_unique<ReplicaReader>(); }

}  // namespace romap::importers
