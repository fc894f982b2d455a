#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>

#include "client/files/text_file.h"
#include "client/importers/any_image.h"
#include "client/importers/depth_image.h"
#include "client/importers/folder.h"
#include "client/importers/frame_times.h"
#include "client/importers/join_masks.h"
#include "client/importers/json_file.h"
#include "client/importers/matrix_pose.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

using nlohmann::json;

constexpr double kMillimeter = 1e-3;

std::optional<std::string> FindTransforms(const std::string& source) {
  if (IsFile(source)) return source;
  return FirstExisting(source, {"transforms.json", "transforms_train.json"});
}

bool BeginsLikeJson(const std::string& path) {
  std::ifstream in(path);
  char first = 0;
  return in >> first && first == '{';
}

// `path` in `folder`; if it has no file, with the extension that has one.
std::string WithExtension(const std::string& folder, const std::string& path) {
  const std::string full = (std::filesystem::path(folder) / path).lexically_normal().string();
  if (IsFile(full)) return full;
  for (const char* extension : {".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"}) {
    if (IsFile(full + extension)) return full + extension;
  }
  return full;
}

absl::Status ReadDistortion(const json& object, const std::string& where, CameraModel* camera) {
  const std::string model = object.value("camera_model", "OPENCV");
  const bool is_fisheye = model == "OPENCV_FISHEYE" || (object.contains("is_fisheye") && object["is_fisheye"] == true);
  if (!is_fisheye && model != "OPENCV" && model != "PINHOLE" && model != "SIMPLE_PINHOLE" && model != "SIMPLE_RADIAL" &&
      model != "RADIAL") {
    return InvalidArgument("{}: camera_model '{}' is not supported; expected OPENCV, OPENCV_FISHEYE or PINHOLE", where,
                           model);
  }
  double k4 = 0;
  std::array<double, 5> k{};
  const std::array<const char*, 5> names = {"k1", "k2", "p1", "p2", "k3"};
  for (size_t i = 0; i < names.size(); ++i) {
    ROMAP_ASSIGN_OR_RETURN(k[i], JsonNumberOr(object, names[i], 0, where));
  }
  ROMAP_ASSIGN_OR_RETURN(k4, JsonNumberOr(object, "k4", 0, where));
  if (is_fisheye) {
    camera->lens = LensModel::kFisheye;
    camera->distortion = {k[0], k[1], k[4], k4, 0};
    return absl::OkStatus();
  }
  if (k4 != 0) return InvalidArgument("{}: k4 is {}; expected 0 without camera_model OPENCV_FISHEYE", where, k4);
  camera->distortion = k;
  return absl::OkStatus();
}

// The intrinsics of the whole file or of one frame. The corner of the image is (0, 0) there.
absl::StatusOr<CameraModel> ReadIntrinsics(const json& object, const std::string& where, cv::Size image_px) {
  CameraModel camera{.width_px = image_px.width, .height_px = image_px.height};
  if (object.contains("w") || image_px.empty()) {
    ROMAP_ASSIGN_OR_RETURN(camera.width_px, JsonSide(object, "w", where));
    ROMAP_ASSIGN_OR_RETURN(camera.height_px, JsonSide(object, "h", where));
  }
  if (object.contains("fl_x")) {
    ROMAP_ASSIGN_OR_RETURN(camera.fx_px, JsonNumber(object, "fl_x", where));
  } else if (object.contains("camera_angle_x")) {
    ROMAP_ASSIGN_OR_RETURN(const double angle, JsonNumber(object, "camera_angle_x", where));
    camera.fx_px = 0.5 * camera.width_px / std::tan(0.5 * angle);
  } else {
    return InvalidArgument("{}: neither 'fl_x' nor 'camera_angle_x'; expected the focal length", where);
  }
  camera.fy_px = camera.fx_px;
  if (object.contains("camera_angle_y") && !object.contains("fl_y") && !object.contains("fl_x")) {
    ROMAP_ASSIGN_OR_RETURN(const double angle, JsonNumber(object, "camera_angle_y", where));
    camera.fy_px = 0.5 * camera.height_px / std::tan(0.5 * angle);
  }
  ROMAP_ASSIGN_OR_RETURN(camera.fy_px, JsonNumberOr(object, "fl_y", camera.fy_px, where));
  ROMAP_ASSIGN_OR_RETURN(camera.cx_px, JsonNumberOr(object, "cx", 0.5 * camera.width_px, where));
  ROMAP_ASSIGN_OR_RETURN(camera.cy_px, JsonNumberOr(object, "cy", 0.5 * camera.height_px, where));
  camera.cx_px -= 0.5;
  camera.cy_px -= 0.5;
  ROMAP_RETURN_IF_ERROR(ReadDistortion(object, where, &camera));
  return camera;
}

// One entry of "frames".
struct TransformsFrame {
  std::string image;
  std::string mask;   // empty: none
  std::string depth;  // empty: none
  std::optional<SE3<World, Camera>> T_world_camera;
  const json* intrinsics = nullptr;  // null: those of the file
  std::string where;
};

absl::StatusOr<std::vector<TransformsFrame>> ReadFrames(const json& root, const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  ROMAP_ASSIGN_OR_RETURN(const json* const list, JsonObjects(root, "frames", path));
  std::vector<TransformsFrame> frames;
  for (size_t k = 0; k < list->size(); ++k) {
    const json& item = (*list)[k];
    TransformsFrame& frame = frames.emplace_back();
    frame.where = fmt::format("{}: frame {}", path, k);
    ROMAP_ASSIGN_OR_RETURN(const std::string image, JsonText(item, "file_path", frame.where));
    frame.image = WithExtension(folder, image);
    ROMAP_ASSIGN_OR_RETURN(const std::vector<double> matrix, JsonNumbers(item, "transform_matrix", frame.where));
    ROMAP_ASSIGN_OR_RETURN(frame.T_world_camera, PoseOfMatrix(matrix, frame.where));
    if (frame.T_world_camera) frame.T_world_camera = FromOpenGl(*frame.T_world_camera);
    if (item.contains("fl_x") || item.contains("camera_angle_x")) frame.intrinsics = &item;
    if (item.contains("mask_path")) {
      ROMAP_ASSIGN_OR_RETURN(const std::string mask, JsonText(item, "mask_path", frame.where));
      frame.mask = WithExtension(folder, mask);
    }
    for (const char* key : {"depth_file_path", "depth_path"}) {
      if (!item.contains(key)) continue;
      ROMAP_ASSIGN_OR_RETURN(const std::string depth, JsonText(item, key, frame.where));
      frame.depth = WithExtension(folder, depth);
    }
  }
  if (frames.empty()) return InvalidArgument("{}: 'frames' is empty", path);
  const bool are_numbered =
      std::ranges::all_of(frames, [](const auto& frame) { return LastNumber(StemOf(frame.image)).has_value(); });
  if (are_numbered) {
    std::ranges::stable_sort(frames, [](const auto& a, const auto& b) { return NaturalLess(a.image, b.image); });
  }
  return frames;
}

class TransformsReader : public SequenceReader {
 public:
  std::string Name() const override { return "NeRF data set with transforms.json"; }
  std::string Expected() const override { return "transforms.json with 'frames' and 'transform_matrix'"; }
  bool Fits(const std::string& source) const override {
    const std::optional<std::string> path = FindTransforms(source);
    if (!path || !BeginsLikeJson(*path)) return false;
    const absl::StatusOr<std::string> text = files::ReadFile(*path);
    return text.ok() && text->find("\"frames\"") != std::string::npos;
  }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions& options) const override {
    const std::string path = *FindTransforms(source);
    ROMAP_ASSIGN_OR_RETURN(const json root, LoadJson(path));
    ROMAP_ASSIGN_OR_RETURN(const std::vector<TransformsFrame> frames, ReadFrames(root, path));
    RecordingContents contents{.source = source};
    const TransformsFrame& first = frames.front();
    const json first_intrinsics = Merged(root, first.intrinsics == nullptr ? json::object() : *first.intrinsics);
    cv::Size image_px;
    if (!first_intrinsics.contains("w")) {
      ROMAP_ASSIGN_OR_RETURN(image_px, ImageSize(first.image));
    }
    ROMAP_ASSIGN_OR_RETURN(contents.camera.camera, ReadIntrinsics(first_intrinsics, path, image_px));
    ROMAP_ASSIGN_OR_RETURN(contents.camera.depth_scale, JsonNumberOr(root, "integer_depth_scale", kMillimeter, path));
    std::vector<std::string> masks;
    for (const TransformsFrame& item : frames) {
      RecordedFrame& frame = contents.frames.emplace_back();
      SetImage(item.image, &frame);
      frame.T_world_camera = item.T_world_camera;
      masks.push_back(item.mask);
      if (!item.depth.empty()) SetDepth(item.depth, {}, contents.camera.camera, &frame);
      if (item.intrinsics == nullptr) continue;
      ROMAP_ASSIGN_OR_RETURN(frame.camera, ReadIntrinsics(Merged(root, *item.intrinsics), item.where, image_px));
    }
    SetMasks(masks, &contents);
    SetTimesByRate(options, &contents);
    return contents;
  }

 private:
  // The values of the file, replaced by those of a frame.
  static json Merged(const json& root, const json& frame) {
    json merged = json::object();
    for (const auto& [key, value] : root.items()) {
      if (key != "frames") merged[key] = value;
    }
    merged.update(frame);
    return merged;
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeTransformsReader() { return std::make_unique<TransformsReader>(); }

}  // namespace romap::importers
