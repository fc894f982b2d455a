#include <memory>

#include "client/importers/any_image.h"
#include "client/importers/depth_image.h"
#include "client/importers/folder.h"
#include "client/importers/frame_times.h"
#include "client/importers/matrix_pose.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

constexpr const char* kColorEnding = ".color.png";

class SevenScenesReader : public SequenceReader {
 public:
  std::string Name() const override { return "7-Scenes sequence"; }
  std::string Expected() const override { return "frame-000000.color.png and frame-000000.pose.txt"; }
  bool Fits(const std::string& source) const override {
    const std::vector<std::string> names = FileNames(source, kColorEnding);
    return !names.empty() && names.front().starts_with("frame-");
  }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions& options) const override {
    RecordingContents contents{.source = source};
    const std::vector<std::string> names = FileNames(source, kColorEnding);
    ROMAP_ASSIGN_OR_RETURN(const cv::Size size_px, ImageSize(source + "/" + names.front()));
    // The data set is not calibrated; its page names these values for 640x480 px.
    const double scale = size_px.width / 640.0;
    contents.camera.camera = {.width_px = size_px.width,
                              .height_px = size_px.height,
                              .fx_px = 585 * scale,
                              .fy_px = 585 * scale,
                              .cx_px = 320 * scale,
                              .cy_px = 240 * scale};
    contents.camera.depth_scale = 1e-3;
    contents.camera.world_up = "auto";  // the world is the first camera of a KinectFusion map
    for (const std::string& name : names) {
      const std::string base = source + "/" + name.substr(0, name.size() - std::string(kColorEnding).size());
      RecordedFrame& frame = contents.frames.emplace_back();
      SetImage(source + "/" + name, &frame);
      frame.name = NameOf(base);
      if (IsFile(base + ".pose.txt")) {
        ROMAP_ASSIGN_OR_RETURN(frame.T_world_camera, ReadMatrixPose(base + ".pose.txt"));
      }
      if (IsFile(base + ".depth.png")) {
        SetDepth(base + ".depth.png", {.unknown = {65535}}, contents.camera.camera, &frame);
      }
    }
    SetTimesByRate(options, &contents);
    return contents;
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeSevenScenesReader() { return std::make_unique<SevenScenesReader>(); }

}  // namespace romap::importers
