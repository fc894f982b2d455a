#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <set>

#include "client/importers/any_image.h"
#include "client/importers/depth_image.h"
#include "client/importers/folder.h"
#include "client/importers/frame_times.h"
#include "client/importers/json_file.h"
#include "client/importers/matrix_pose.h"
#include "client/importers/png_masks.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

const std::set<std::string> kScanNetShell = {"wall", "floor", "ceiling"};

absl::StatusOr<CameraModel> ReadIntrinsicMatrix(const std::string& path, cv::Size size_px) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> m, ReadNumbers(path));
  if (m.size() != 16 && m.size() != 9) {
    return InvalidArgument("{}: {} numbers; expected a 4x4 matrix with the intrinsics", path, m.size());
  }
  const size_t row = m.size() == 16 ? 4 : 3;
  return CameraModel{.width_px = size_px.width,
                     .height_px = size_px.height,
                     .fx_px = m[0],
                     .fy_px = m[row + 1],
                     .cx_px = m[2],
                     .cy_px = m[row + 2]};
}

// The class of each label, from the only *.aggregation.json in the folder: labels are objectId + 1.
absl::StatusOr<std::map<uint32_t, std::string>> ReadAggregation(const std::string& source) {
  std::map<uint32_t, std::string> classes;
  for (const std::string& name : FileNames(source, ".aggregation.json")) {
    const std::string path = source + "/" + name;
    ROMAP_ASSIGN_OR_RETURN(const nlohmann::json root, LoadJson(path));
    ROMAP_ASSIGN_OR_RETURN(const nlohmann::json* const groups, JsonObjects(root, "segGroups", path));
    for (const nlohmann::json& group : *groups) {
      ROMAP_ASSIGN_OR_RETURN(const int64_t id, JsonWhole(group, "objectId", path));
      ROMAP_ASSIGN_OR_RETURN(classes[static_cast<uint32_t>(id) + 1], JsonText(group, "label", path));
    }
    break;
  }
  return classes;
}

absl::StatusOr<EncodedMasks> LoadScanNetMask(const std::string& path, const std::map<uint32_t, std::string>& classes,
                                             cv::Size size_px) {
  ROMAP_ASSIGN_OR_RETURN(cv::Mat labels, ReadLabels(path, size_px));
  EncodedMasks masks{.mask_encoding = MaskEncoding::kLabelPng, .label_png = {}, .label_runs = {}, .instances = {}};
  for (const auto& [label, name] : classes) {
    const cv::Mat pixels = labels == static_cast<int>(label);
    if (cv::countNonZero(pixels) == 0) continue;
    if (kScanNetShell.contains(name)) {
      labels.setTo(0, pixels);
    } else {
      masks.instances.push_back({.label = label, .class_name = name, .score = 1, .track_id = {}});
    }
  }
  masks.label_png = EncodeLabelImage(labels);
  return masks;
}

class ScanNetReader : public SequenceReader {
 public:
  std::string Name() const override { return "ScanNet export"; }
  std::string Expected() const override { return "color/0.jpg, pose/0.txt and intrinsic/intrinsic_color.txt"; }
  bool Fits(const std::string& source) const override {
    return IsFolder(source + "/intrinsic") && IsFolder(source + "/pose") && !FileNames(source + "/color").empty();
  }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions& options) const override {
    RecordingContents contents{.source = source};
    const std::vector<std::string> names = FileNames(source + "/color");
    ROMAP_ASSIGN_OR_RETURN(const cv::Size size_px, ImageSize(source + "/color/" + names.front()));
    CameraModel& camera = contents.camera.camera;
    ROMAP_ASSIGN_OR_RETURN(camera, ReadIntrinsicMatrix(source + "/intrinsic/intrinsic_color.txt", size_px));
    contents.camera.depth_scale = 1e-3;
    ROMAP_ASSIGN_OR_RETURN(const DepthRules rules, RulesOf(source, camera));
    ROMAP_ASSIGN_OR_RETURN(const auto classes, ReadAggregation(source));
    for (const std::string& name : names) {
      RecordedFrame& frame = contents.frames.emplace_back();
      const std::string stem = StemOf(name);
      SetImage(source + "/color/" + name, &frame);
      if (const std::string pose = source + "/pose/" + stem + ".txt"; IsFile(pose)) {
        ROMAP_ASSIGN_OR_RETURN(frame.T_world_camera, ReadMatrixPose(pose));
      }
      if (const std::string depth = source + "/depth/" + stem + ".png"; IsFile(depth)) {
        SetDepth(depth, rules, camera, &frame);
      }
      const auto mask =
          FirstExisting(source, {("instance-filt/" + stem + ".png").c_str(), ("instance/" + stem + ".png").c_str()});
      if (!mask) continue;
      frame.paths.mask = *mask;
      frame.load_masks = [path = *mask, classes, size_px] { return LoadScanNetMask(path, classes, size_px); };
    }
    SetTimesByRate(options, &contents);
    return contents;
  }

 private:
  // The depth images have a camera of their own with another resolution, from the same viewpoint.
  static absl::StatusOr<DepthRules> RulesOf(const std::string& source, const CameraModel& color) {
    const std::vector<std::string> names = FileNames(source + "/depth", ".png");
    const std::string path = source + "/intrinsic/intrinsic_depth.txt";
    if (names.empty() || !IsFile(path)) return DepthRules();
    ROMAP_ASSIGN_OR_RETURN(const cv::Size size_px, ImageSize(source + "/depth/" + names.front()));
    ROMAP_ASSIGN_OR_RETURN(const CameraModel camera, ReadIntrinsicMatrix(path, size_px));
    return camera == color ? DepthRules() : DepthRules{.camera = camera};
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeScanNetReader() { return std::make_unique<ScanNetReader>(); }

}  // namespace romap::importers
