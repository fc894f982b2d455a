#include <algorithm>
#include <map>
#include <memory>

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

constexpr double kMeters = 1e-3;  // per millimeter

// The instances of one image that are visible.
absl::StatusOr<std::vector<InstancePng>> BopInstances(const std::string& source, const nlohmann::json& ground_truth,
                                                      const nlohmann::json& info, int64_t image,
                                                      const std::string& where) {
  std::vector<InstancePng> instances;
  const std::string key = std::to_string(image);
  for (size_t k = 0; k < ground_truth.size(); ++k) {
    ROMAP_ASSIGN_OR_RETURN(const int64_t object, JsonWhole(ground_truth[k], "obj_id", where));
    if (info.contains(key) && k < info[key].size() && info[key][k].value("px_count_visib", 1) == 0) continue;
    instances.push_back(
        {fmt::format("{}/mask_visib/{:06}_{:06}.png", source, image, k), fmt::format("obj_{}", object)});
  }
  return instances;
}

absl::Status ReadBopCamera(const nlohmann::json& values, const std::string& where, cv::Size size_px,
                           RecordedFrame* frame) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> k, JsonNumbers(values, "cam_K", where));
  if (k.size() != 9) return InvalidArgument("{}: 'cam_K' has {} numbers; expected 9", where, k.size());
  frame->camera = CameraModel{.width_px = size_px.width,
                              .height_px = size_px.height,
                              .fx_px = k[0],
                              .fy_px = k[4],
                              .cx_px = k[2],
                              .cy_px = k[5]};
  ROMAP_ASSIGN_OR_RETURN(const double depth_scale, JsonNumberOr(values, "depth_scale", 1, where));
  frame->depth_scale_mu = kMeters * depth_scale;
  if (!values.contains("cam_R_w2c") || !values.contains("cam_t_w2c")) return absl::OkStatus();
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> r, JsonNumbers(values, "cam_R_w2c", where));
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> t, JsonNumbers(values, "cam_t_w2c", where));
  if (r.size() != 9 || t.size() != 3) {
    return InvalidArgument("{}: 'cam_R_w2c' and 'cam_t_w2c' have {} and {} numbers; expected 9 and 3", where, r.size(),
                           t.size());
  }
  const std::vector<double> matrix = {r[0], r[1],           r[2], kMeters * t[0], r[3], r[4],
                                      r[5], kMeters * t[1], r[6], r[7],           r[8], kMeters * t[2]};
  ROMAP_ASSIGN_OR_RETURN(frame->T_world_camera, PoseOfMatrix(matrix, where));
  if (frame->T_world_camera) frame->T_world_camera = FromWorldToCamera(*frame->T_world_camera);
  return absl::OkStatus();
}

// The images of a folder by their numbers.
std::map<int64_t, std::string> BopImages(const std::string& source) {
  std::map<int64_t, std::string> images;
  for (const char* folder : {"/rgb", "/gray"}) {
    if (!images.empty()) break;
    for (const std::string& name : FileNames(source + folder)) {
      if (const auto number = LastNumber(StemOf(name))) images[*number] = source + folder + "/" + name;
    }
  }
  return images;
}

absl::StatusOr<nlohmann::json> LoadIfPresent(const std::string& path) {
  return IsFile(path) ? LoadJson(path) : nlohmann::json::object();
}

class BopReader : public SequenceReader {
 public:
  std::string Name() const override { return "BOP scene"; }
  std::string Expected() const override { return "scene_camera.json and rgb/ or gray/"; }
  bool Fits(const std::string& source) const override { return IsFile(source + "/scene_camera.json"); }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions& options) const override {
    RecordingContents contents{.source = source};
    const std::string cameras_path = source + "/scene_camera.json";
    ROMAP_ASSIGN_OR_RETURN(const nlohmann::json cameras, LoadJson(cameras_path));
    ROMAP_ASSIGN_OR_RETURN(const nlohmann::json truth, LoadIfPresent(source + "/scene_gt.json"));
    ROMAP_ASSIGN_OR_RETURN(const nlohmann::json info, LoadIfPresent(source + "/scene_gt_info.json"));
    const std::map<int64_t, std::string> images = BopImages(source);
    if (images.empty()) return NotFound("{}/rgb has no images, nor has {}/gray", source, source);
    ROMAP_ASSIGN_OR_RETURN(const cv::Size size_px, ImageSize(images.begin()->second));
    for (const auto& [number, path] : images) {
      const std::string key = std::to_string(number);
      const std::string where = fmt::format("{}: image {}", cameras_path, key);
      if (!cameras.contains(key)) return InvalidArgument("{}: missing, but {} exists", where, path);
      RecordedFrame& frame = contents.frames.emplace_back();
      SetImage(path, &frame);
      ROMAP_RETURN_IF_ERROR(ReadBopCamera(cameras[key], where, size_px, &frame));
      if (const std::string depth = fmt::format("{}/depth/{:06}.png", source, number); IsFile(depth)) {
        SetDepth(depth, {}, *frame.camera, &frame);
      }
      if (!truth.contains(key) || !IsFolder(source + "/mask_visib")) continue;
      ROMAP_ASSIGN_OR_RETURN(const std::vector<InstancePng> instances,
                             BopInstances(source, truth[key], info, number, source + "/scene_gt.json"));
      frame.paths.mask = fmt::format("{}/mask_visib/{:06}_*.png", source, number);
      frame.load_masks = [instances, size_px] { return LoadInstancePngs(instances, size_px); };
    }
    contents.camera.camera = *contents.frames.front().camera;
    contents.camera.depth_scale = contents.frames.front().depth_scale_mu;
    contents.camera.world_up = "auto";
    SetTimesByRate(options, &contents);
    return contents;
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeBopReader() { return std::make_unique<BopReader>(); }

}  // namespace romap::importers
