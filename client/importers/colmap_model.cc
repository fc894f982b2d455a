#include "client/importers/colmap_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string_view>

#include "client/files/text_file.h"
#include "client/files/whole_number.h"
#include "client/importers/folder.h"

namespace romap::importers {
namespace {

struct ColmapLens {
  int id;
  const char* name;
  size_t parameters;
};
constexpr std::array<ColmapLens, 11> kColmapLenses = {{{0, "SIMPLE_PINHOLE", 3},
                                                       {1, "PINHOLE", 4},
                                                       {2, "SIMPLE_RADIAL", 4},
                                                       {3, "RADIAL", 5},
                                                       {4, "OPENCV", 8},
                                                       {5, "OPENCV_FISHEYE", 8},
                                                       {6, "FULL_OPENCV", 12},
                                                       {7, "FOV", 5},
                                                       {8, "SIMPLE_RADIAL_FISHEYE", 4},
                                                       {9, "RADIAL_FISHEYE", 5},
                                                       {10, "THIN_PRISM_FISHEYE", 12}}};

// Takes little-endian values from a binary file.
class ByteReader {
 public:
  ByteReader(std::string path, std::string bytes) : path_(std::move(path)), bytes_(std::move(bytes)) {}

  template <class T>
  absl::StatusOr<T> Take() {
    ROMAP_RETURN_IF_ERROR(Need(sizeof(T)));
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }

  absl::StatusOr<std::string> TakeName() {
    const size_t end = bytes_.find('\0', at_);
    if (end == std::string::npos) return Need(bytes_.size() - at_ + 1);
    std::string name = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    return name;
  }

  absl::Status Skip(uint64_t items, uint64_t item_bytes) {
    if (items > bytes_.size()) return Need(bytes_.size() + 1);
    ROMAP_RETURN_IF_ERROR(Need(items * item_bytes));
    at_ += items * item_bytes;
    return absl::OkStatus();
  }

  const std::string& path() const { return path_; }

 private:
  absl::Status Need(uint64_t count) const {
    if (count <= bytes_.size() - at_) return absl::OkStatus();
    return InvalidArgument("{}: truncated at byte {} ({} bytes); expected a binary COLMAP model", path_, at_,
                           bytes_.size());
  }

  std::string path_, bytes_;
  size_t at_ = 0;
};

absl::StatusOr<ColmapImage> ColmapImageOf(const std::array<double, 7>& pose, int64_t camera_id, std::string name,
                                          const std::string& where) {
  const Eigen::Quaterniond rotation(pose[0], pose[1], pose[2], pose[3]);
  if (!(std::abs(rotation.norm() - 1) < 0.05)) {
    return InvalidArgument("{}: quaternion norm is {:.3f}; expected 1", where, rotation.norm());
  }
  if (!std::ranges::all_of(pose, [](double number) { return std::isfinite(number); })) {
    return InvalidArgument("{}: the pose is not finite", where);
  }
  const SE3<Camera, World> T_camera_world(rotation, Eigen::Vector3d(pose[4], pose[5], pose[6]));
  return ColmapImage{std::move(name), camera_id, T_camera_world.Inverse()};
}

absl::Status ReadBinaryCameras(const std::string& path, ColmapModel* model) {
  ROMAP_ASSIGN_OR_RETURN(std::string bytes, files::ReadFile(path));
  ByteReader reader(path, std::move(bytes));
  ROMAP_ASSIGN_OR_RETURN(const uint64_t count, reader.Take<uint64_t>());
  for (uint64_t k = 0; k < count; ++k) {
    ROMAP_ASSIGN_OR_RETURN(const int32_t id, reader.Take<int32_t>());
    ROMAP_ASSIGN_OR_RETURN(const int32_t lens, reader.Take<int32_t>());
    ROMAP_ASSIGN_OR_RETURN(const uint64_t width_px, reader.Take<uint64_t>());
    ROMAP_ASSIGN_OR_RETURN(const uint64_t height_px, reader.Take<uint64_t>());
    const std::string where = fmt::format("{}: camera {}", path, id);
    const auto known = std::ranges::find(kColmapLenses, lens, &ColmapLens::id);
    if (known == kColmapLenses.end()) {
      return InvalidArgument("{}: camera model {} is unknown; expected 0 to {}", where, lens, kColmapLenses.size() - 1);
    }
    std::vector<double> parameters(known->parameters);
    for (double& parameter : parameters) {
      ROMAP_ASSIGN_OR_RETURN(parameter, reader.Take<double>());
    }
    ROMAP_ASSIGN_OR_RETURN(model->cameras[id], ColmapCamera(known->name, width_px, height_px, parameters, where));
  }
  return absl::OkStatus();
}

absl::Status ReadBinaryImages(const std::string& path, ColmapModel* model) {
  constexpr uint64_t kPointBytes = 24;  // x, y, id of the 3D point
  ROMAP_ASSIGN_OR_RETURN(std::string bytes, files::ReadFile(path));
  ByteReader reader(path, std::move(bytes));
  ROMAP_ASSIGN_OR_RETURN(const uint64_t count, reader.Take<uint64_t>());
  for (uint64_t k = 0; k < count; ++k) {
    ROMAP_ASSIGN_OR_RETURN(const int32_t id, reader.Take<int32_t>());
    std::array<double, 7> pose{};
    for (double& value : pose) {
      ROMAP_ASSIGN_OR_RETURN(value, reader.Take<double>());
    }
    ROMAP_ASSIGN_OR_RETURN(const int32_t camera_id, reader.Take<int32_t>());
    ROMAP_ASSIGN_OR_RETURN(std::string name, reader.TakeName());
    ROMAP_ASSIGN_OR_RETURN(const uint64_t points, reader.Take<uint64_t>());
    ROMAP_RETURN_IF_ERROR(reader.Skip(points, kPointBytes));
    ROMAP_ASSIGN_OR_RETURN(model->images.emplace_back(),
                           ColmapImageOf(pose, camera_id, std::move(name), fmt::format("{}: image {}", path, id)));
  }
  return absl::OkStatus();
}

absl::Status ReadTextCameras(const std::string& path, ColmapModel* model) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<files::TableLine> lines, files::ReadTable(path));
  for (const files::TableLine& line : lines) {
    const std::string where = fmt::format("{}:{}", path, line.number);
    if (line.fields.size() < 5) return InvalidArgument("{}: expected 'id model width height parameters'", where);
    std::vector<double> numbers;
    for (size_t k = 0; k < line.fields.size(); ++k) {
      if (k == 1) continue;
      const auto number = files::ParseNumber(line.fields[k]);
      if (!number) return InvalidArgument("{}: '{}' is not a number", where, line.fields[k]);
      numbers.push_back(*number);
    }
    const std::vector<double> parameters(numbers.begin() + 3, numbers.end());
    const auto id = files::WholeNumber(numbers[0]);
    if (!id) return InvalidArgument("{}: the id '{}' is not a whole number", where, line.fields[0]);
    ROMAP_ASSIGN_OR_RETURN(model->cameras[*id],
                           ColmapCamera(line.fields[1], static_cast<uint64_t>(files::SideOf_px(numbers[1])),
                                        static_cast<uint64_t>(files::SideOf_px(numbers[2])), parameters, where));
  }
  return absl::OkStatus();
}

// "id qw qx qy qz tx ty tz camera_id name"; the name may contain blanks.
absl::StatusOr<ColmapImage> ParseImageLine(std::string_view line, const std::string& where) {
  std::array<double, 9> numbers{};
  for (double& number : numbers) {
    line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
    const std::string_view field = line.substr(0, line.find_first_of(" \t"));
    const auto value = files::ParseNumber(field);
    if (!value) return InvalidArgument("{}: expected 'id qw qx qy qz tx ty tz camera name'", where);
    number = *value;
    line.remove_prefix(field.size());
  }
  line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  const size_t end = line.find_last_not_of(" \t\r");
  if (line.empty() || end == std::string_view::npos) return InvalidArgument("{}: the name is missing", where);
  std::array<double, 7> pose{};
  std::copy_n(numbers.begin() + 1, pose.size(), pose.begin());
  const auto camera_id = files::WholeNumber(numbers[8]);
  if (!camera_id) return InvalidArgument("{}: the camera '{}' is not a whole number", where, numbers[8]);
  return ColmapImageOf(pose, *camera_id, std::string(line.substr(0, end + 1)), where);
}

// Each image has two lines; the second one, with its points, is empty if it has none.
absl::Status ReadTextImages(const std::string& path, ColmapModel* model) {
  ROMAP_ASSIGN_OR_RETURN(const std::string text, files::ReadTextFile(path));
  bool is_points_line = false;
  size_t begin = 0;
  for (int number = 1; begin < text.size(); ++number) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = std::string_view(text).substr(begin, end - begin);
    begin = end + 1;
    if (std::exchange(is_points_line, false)) continue;
    const size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string_view::npos || line[first] == '#') continue;
    ROMAP_ASSIGN_OR_RETURN(model->images.emplace_back(), ParseImageLine(line, fmt::format("{}:{}", path, number)));
    is_points_line = true;
  }
  return absl::OkStatus();
}

bool HasPair(const std::string& folder, const char* extension) {
  return IsFile(folder + "/cameras" + extension) && IsFile(folder + "/images" + extension);
}

}  // namespace

bool HasColmapModel(const std::string& folder) { return HasPair(folder, ".bin") || HasPair(folder, ".txt"); }

absl::StatusOr<CameraModel> ColmapCamera(const std::string& model, uint64_t width_px, uint64_t height_px,
                                         const std::vector<double>& parameters, const std::string& where) {
  const auto known = std::ranges::find_if(kColmapLenses, [&](const ColmapLens& lens) { return model == lens.name; });
  const std::vector<double>& p = parameters;
  if (known == kColmapLenses.end() || model == "FOV" || model == "THIN_PRISM_FISHEYE") {
    return InvalidArgument(
        "{}: camera model {} is not supported; undistort the images with COLMAP, or use SIMPLE_PINHOLE, PINHOLE, "
        "SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV with k4 = k5 = k6 = 0, or a fisheye model with up to four "
        "coefficients",
        where, model);
  }
  if (p.size() != known->parameters) {
    return InvalidArgument("{}: {} parameters; {} has {}", where, p.size(), model, known->parameters);
  }
  if (width_px > 1'000'000 || height_px > 1'000'000) {
    return InvalidArgument("{}: the size is {}x{} px", where, width_px, height_px);
  }
  CameraModel camera{.width_px = static_cast<int>(width_px), .height_px = static_cast<int>(height_px)};
  const bool one_focal = model.starts_with("SIMPLE") || model.starts_with("RADIAL");
  size_t at = one_focal ? 1 : 2;
  camera.fx_px = p[0];
  camera.fy_px = one_focal ? p[0] : p[1];
  camera.cx_px = p[at] - 0.5;
  camera.cy_px = p[at + 1] - 0.5;
  at += 2;
  if (model == "FULL_OPENCV" && (p[9] != 0 || p[10] != 0 || p[11] != 0)) {
    return InvalidArgument(
        "{}: camera model FULL_OPENCV with k4 = {}, k5 = {}, k6 = {} is not supported; expected 0, or images that "
        "COLMAP has undistorted",
        where, p[9], p[10], p[11]);
  }
  if (model.ends_with("FISHEYE")) camera.lens = LensModel::kFisheye;
  std::copy_n(p.begin() + static_cast<std::ptrdiff_t>(at), std::min<size_t>(p.size() - at, 5),
              camera.distortion.begin());
  return camera;
}

absl::StatusOr<ColmapModel> ReadColmapModel(const std::string& folder) {
  ColmapModel model;
  if (HasPair(folder, ".bin")) {
    ROMAP_RETURN_IF_ERROR(ReadBinaryCameras(folder + "/cameras.bin", &model));
    ROMAP_RETURN_IF_ERROR(ReadBinaryImages(folder + "/images.bin", &model));
  } else {
    ROMAP_RETURN_IF_ERROR(ReadTextCameras(folder + "/cameras.txt", &model));
    ROMAP_RETURN_IF_ERROR(ReadTextImages(folder + "/images.txt", &model));
  }
  return model;
}

}  // namespace romap::importers
