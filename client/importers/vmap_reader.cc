#include <algorithm>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <set>

#include "client/files/camera_yaml.h"
#include "client/importers/any_image.h"
#include "client/importers/depth_image.h"
#include "client/importers/folder.h"
#include "client/importers/frame_times.h"
#include "client/importers/mask_layers.h"
#include "client/importers/matrix_pose.h"
#include "client/importers/png_masks.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

// Class ids of Replica (info_semantic.json) for the shell of a room: ceiling, floor, wall. Instances of these classes
// are background.
const std::set<uint16_t> kShellClasses = {31, 40, 93};

// The image `FOLDER/FOLDER_N.png` of number N.
std::string NumberedPath(const std::string& source, const std::string& folder, int64_t number) {
  return fmt::format("{0}/{1}/{1}_{2}.png", source, folder, number);
}

// The instances of a frame, without the shell of the room, and with the most frequent class of their pixels as name.
absl::StatusOr<EncodedMasks> LoadWithClasses(const std::string& instances_path, const std::string& classes_path,
                                             cv::Size size_px) {
  ROMAP_ASSIGN_OR_RETURN(cv::Mat labels, ReadLabels(instances_path, size_px));
  ROMAP_ASSIGN_OR_RETURN(const cv::Mat classes, ReadLabels(classes_path, size_px));
  std::map<uint16_t, std::map<uint16_t, int>> votes;
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) ++votes[labels.at<uint16_t>(y, x)][classes.at<uint16_t>(y, x)];
  }
  EncodedMasks masks{.mask_encoding = MaskEncoding::kLabelPng, .label_png = {}, .label_runs = {}, .instances = {}};
  for (const auto& [label, counts] : votes) {
    if (label == 0) continue;
    const auto winner = std::ranges::max_element(counts, {}, [](const auto& entry) { return entry.second; });
    if (kShellClasses.contains(winner->first)) {
      labels.setTo(0, labels == static_cast<int>(label));
    } else {
      masks.instances.push_back(
          {.label = label, .class_name = fmt::format("class_{}", winner->first), .score = 1, .track_id = {}});
    }
  }
  masks.label_png = EncodeLabelImage(labels);
  return masks;
}

class VmapReader : public SequenceReader {
 public:
  std::string Name() const override { return "Replica scene of vMAP or Semantic-NeRF"; }
  std::string Expected() const override { return "traj_w_c.txt and rgb/rgb_0.png"; }
  bool Fits(const std::string& source) const override {
    return IsFile(source + "/traj_w_c.txt") && !FileNames(source + "/rgb").empty();
  }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions& options) const override {
    RecordingContents contents{.source = source};
    const std::vector<std::string> names = FileNames(source + "/rgb");
    ROMAP_ASSIGN_OR_RETURN(const cv::Size size_px, ImageSize(source + "/rgb/" + names.front()));
    ROMAP_RETURN_IF_ERROR(SetCamera(source, size_px, &contents.camera));
    const std::string trajectory = source + "/traj_w_c.txt";
    ROMAP_ASSIGN_OR_RETURN(const std::vector<std::vector<double>> lines, ReadNumberLines(trajectory));
    for (const std::string& name : names) {
      const std::optional<int64_t> number = LastNumber(StemOf(name));
      if (!number) continue;
      RecordedFrame& frame = contents.frames.emplace_back();
      SetImage(source + "/rgb/" + name, &frame);
      if (const std::string depth = NumberedPath(source, "depth", *number); IsFile(depth)) {
        SetDepth(depth, {}, contents.camera.camera, &frame);
      }
      SetInstances(source, *number, size_px, &frame);
      const auto line = static_cast<size_t>(*number);
      ROMAP_ASSIGN_OR_RETURN(frame.T_world_camera, PoseOfLine(lines, line, trajectory));
    }
    SetTimesByRate(options, &contents);
    return contents;
  }

 private:
  // The folder has no calibration unless the user adds one: both data sets were rendered with a horizontal field of
  // view of 90 degrees.
  static absl::Status SetCamera(const std::string& source, cv::Size size_px, files::CameraYaml* calibration) {
    if (IsFile(source + "/camera.yaml")) {
      ROMAP_ASSIGN_OR_RETURN(*calibration, files::ReadCameraYaml(source + "/camera.yaml"));
    } else {
      calibration->camera = {.width_px = size_px.width,
                             .height_px = size_px.height,
                             .fx_px = 0.5 * size_px.width,
                             .fy_px = 0.5 * size_px.width,
                             .cx_px = 0.5 * (size_px.width - 1),
                             .cy_px = 0.5 * (size_px.height - 1)};
    }
    if (calibration->depth_scale == 0) calibration->depth_scale = 1e-3;
    return absl::OkStatus();
  }

  static void SetInstances(const std::string& source, int64_t number, cv::Size size_px, RecordedFrame* frame) {
    const std::string instances = NumberedPath(source, "semantic_instance", number);
    if (!IsFile(instances)) return;
    frame->paths.mask = instances;
    const std::string classes = NumberedPath(source, "semantic_class", number);
    if (!IsFile(classes)) return;
    frame->load_masks = [instances, classes, size_px] { return LoadWithClasses(instances, classes, size_px); };
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeVmapReader() { return std::make_unique<VmapReader>(); }

}  // namespace romap::importers
