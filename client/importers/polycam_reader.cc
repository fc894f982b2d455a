#include <memory>

#include "client/files/time_unit.h"
#include "client/importers/any_image.h"
#include "client/importers/depth_image.h"
#include "client/importers/folder.h"
#include "client/importers/frame_times.h"
#include "client/importers/json_file.h"
#include "client/importers/matrix_pose.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

constexpr int kHighestPolycamConfidence = 255;

// The folders of an export. The corrected ones exist if the app has optimized the poses.
struct PolycamFolders {
  std::string cameras, images, depth, confidence;
};

std::optional<PolycamFolders> FindPolycamFolders(const std::string& source) {
  for (const std::string& root : {source + "/keyframes", source}) {
    for (const char* corrected : {"corrected_", ""}) {
      PolycamFolders folders{root + "/" + corrected + "cameras", root + "/" + corrected + "images", root + "/depth",
                             root + "/confidence"};
      if (!FileNames(folders.cameras, ".json").empty() && IsFolder(folders.images)) return folders;
    }
  }
  return std::nullopt;
}

// The corner of the image is (0, 0). The camera has the axes of OpenGL.
absl::Status ReadPolycamCamera(const std::string& path, RecordedFrame* frame) {
  ROMAP_ASSIGN_OR_RETURN(const nlohmann::json values, LoadJson(path));
  ROMAP_ASSIGN_OR_RETURN(CameraModel camera, JsonCamera(values, "width", "height", path));
  camera.cx_px -= 0.5;
  camera.cy_px -= 0.5;
  frame->camera = camera;
  std::vector<double> matrix;
  for (const char row : {'0', '1', '2'}) {
    for (const char column : {'0', '1', '2', '3'}) {
      ROMAP_ASSIGN_OR_RETURN(const double value, JsonNumber(values, std::string("t_") + row + column, path));
      matrix.push_back(value);
    }
  }
  ROMAP_ASSIGN_OR_RETURN(const auto pose, PoseOfMatrix(matrix, path));
  if (pose) frame->T_world_camera = FromOpenGl(*pose);
  return absl::OkStatus();
}

class PolycamReader : public SequenceReader {
 public:
  std::string Name() const override { return "Polycam raw data"; }
  std::string Expected() const override { return "keyframes/cameras/*.json or keyframes/corrected_cameras/*.json"; }
  bool Fits(const std::string& source) const override { return FindPolycamFolders(source).has_value(); }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions&) const override {
    const PolycamFolders folders = *FindPolycamFolders(source);
    RecordingContents contents{.source = source};
    std::vector<std::string> stems;
    for (const std::string& name : FileNames(folders.cameras, ".json")) stems.push_back(StemOf(name));
    const files::TimeUnit unit = files::DetectTimeUnit(stems);
    for (const std::string& stem : stems) {
      const std::optional<int64_t> time_ns = files::ParseTimestamp(stem, unit);
      if (!time_ns) return InvalidArgument("{}/{}.json: the name is no time", folders.cameras, stem);
      RecordedFrame& frame = contents.frames.emplace_back();
      frame.timestamp_ns = *time_ns;
      ROMAP_RETURN_IF_ERROR(ReadPolycamCamera(folders.cameras + "/" + stem + ".json", &frame));
      const auto image = FirstExisting(folders.images, {(stem + ".jpg").c_str(), (stem + ".png").c_str()});
      SetImage(image.value_or(folders.images + "/" + stem + ".jpg"), &frame);
      const std::string depth = folders.depth + "/" + stem + ".png";
      if (!IsFile(depth)) continue;
      DepthRules rules{.min_confidence = kHighestPolycamConfidence};
      if (const std::string path = folders.confidence + "/" + stem + ".png"; IsFile(path)) rules.confidence = path;
      SetDepth(depth, rules, *frame.camera, &frame);
    }
    contents.camera.camera = *contents.frames.front().camera;
    contents.camera.depth_scale = 1e-3;
    contents.camera.world_up = std::string("y");  // GCC 12 warns of an assignment of the literal
    SortByTime(&contents);
    SetRateByTimes(&contents);
    return contents;
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakePolycamReader() { return std::make_unique<PolycamReader>(); }

}  // namespace romap::importers
