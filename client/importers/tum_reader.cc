#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>

#include "client/files/associate.h"
#include "client/files/file_list.h"
#include "client/files/text_file.h"
#include "client/importers/any_image.h"
#include "client/importers/calibration_guess.h"
#include "client/importers/depth_image.h"
#include "client/importers/folder.h"
#include "client/importers/frame_times.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

constexpr int64_t kMaxTumDistance_ns = 20'000'000;
constexpr double kTumDepthScale = 1.0 / 5000;

// The calibrations that the web page of the benchmark states for the cameras of 640x480 px, by a part of the folder's
// name. The last one is the default of the device's driver.
struct TumCalibration {
  const char* name;
  std::array<double, 4> intrinsics_px;  // fx fy cx cy
  std::array<double, 5> distortion;
};
constexpr std::array<TumCalibration, 4> kTumCalibrations = {
    {{"freiburg1", {517.3, 516.5, 318.6, 255.3}, {0.2624, -0.9531, -0.0054, 0.0026, 1.1633}},
     {"freiburg2", {520.9, 521.0, 325.1, 249.7}, {0.2312, -0.7849, -0.0033, -0.0001, 0.9172}},
     {"freiburg3", {535.4, 539.2, 320.1, 247.6}, {}},
     {"", {525.0, 525.0, 319.5, 239.5}, {}}}};

struct TumLists {
  std::vector<files::ListedFile> color, depth;
};

constexpr std::array kAssociationNames = {"associations.txt", "associated.txt", "association.txt", "associate.txt",
                                          "assoc.txt"};

std::optional<std::string> FindAssociations(const std::string& source) {
  for (const char* name : kAssociationNames) {
    if (IsFile(source + "/" + name)) return source + "/" + name;
  }
  return std::nullopt;
}

// Lines of `timestamp filename timestamp filename`, color and depth in either order.
absl::StatusOr<TumLists> ReadAssociations(const std::string& source, const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<files::TableLine> lines, files::ReadTable(path));
  TumLists lists;
  for (const files::TableLine& line : lines) {
    std::array<files::ListedFile, 2> pair;
    for (size_t k = 0; k < 2; ++k) {
      const auto time_ns = line.fields.size() == 4 ? files::ParseSeconds(line.fields[2 * k]) : std::nullopt;
      if (!time_ns) {
        return InvalidArgument("{}:{}: expected 'timestamp filename timestamp filename'", path, line.number);
      }
      pair[k] = {*time_ns, source + "/" + line.fields[2 * k + 1]};
    }
    const bool depth_first = line.fields[1].find("depth") != std::string::npos;
    lists.color.push_back(pair[depth_first ? 1 : 0]);
    lists.depth.push_back(pair[depth_first ? 0 : 1]);
  }
  std::ranges::sort(lists.color, {}, &files::ListedFile::timestamp_ns);
  std::ranges::sort(lists.depth, {}, &files::ListedFile::timestamp_ns);
  return lists;
}

// Files whose names are their timestamps.
std::vector<files::ListedFile> StampedFiles(const std::string& folder) {
  std::vector<files::ListedFile> list;
  for (const std::string& name : FileNames(folder)) {
    const std::string stem = StemOf(name);
    if (stem.find('.') == std::string::npos) continue;
    if (const auto time_ns = files::ParseSeconds(stem)) list.push_back({*time_ns, folder + "/" + name});
  }
  std::ranges::sort(list, {}, &files::ListedFile::timestamp_ns);
  return list;
}

absl::StatusOr<TumLists> ReadLists(const std::string& source) {
  if (IsFile(source + "/rgb.txt")) {
    ROMAP_ASSIGN_OR_RETURN(files::FileList color, files::ReadFileList(source, "rgb.txt"));
    TumLists lists{.color = std::move(color.files), .depth = {}};
    if (IsFile(source + "/depth.txt")) {
      ROMAP_ASSIGN_OR_RETURN(files::FileList depth, files::ReadFileList(source, "depth.txt"));
      lists.depth = std::move(depth.files);
    }
    return lists;
  }
  if (const auto path = FindAssociations(source)) return ReadAssociations(source, *path);
  return TumLists{StampedFiles(source + "/rgb"), StampedFiles(source + "/depth")};
}

absl::Status Calibrate(const std::string& source, const std::string& first_image, const ReadOptions& options,
                       RecordingContents* contents) {
  ROMAP_ASSIGN_OR_RETURN(const cv::Size size_px, ImageSize(first_image));
  if (size_px != cv::Size(640, 480) || options.focal_px > 0 || IsFile(source + "/camera.yaml")) {
    return GuessCalibration(source, first_image, size_px, options, contents);
  }
  const std::string folder = std::filesystem::absolute(source).lexically_normal().string();
  const auto known = std::ranges::find_if(
      kTumCalibrations, [&](const TumCalibration& c) { return folder.find(c.name) != std::string::npos; });
  CameraModel& camera = contents->camera.camera;
  camera = {.width_px = 640, .height_px = 480};
  camera.fx_px = known->intrinsics_px[0];
  camera.fy_px = known->intrinsics_px[1];
  camera.cx_px = known->intrinsics_px[2];
  camera.cy_px = known->intrinsics_px[3];
  camera.distortion = known->distortion;
  const bool is_default = *known->name == '\0';
  contents->diagnostics.push_back(
      {.code = "calibration_guessed",
       .severity = is_default ? Severity::kWarning : Severity::kInfo,
       .text = is_default ? "no calibration: focal length 525.0 px, the default of the TUM RGB-D benchmark"
                          : fmt::format("no calibration: that of {} of the TUM RGB-D benchmark", known->name),
       .advice = "write camera.yaml into the folder if this is another camera"});
  return absl::OkStatus();
}

class TumReader : public SequenceReader {
 public:
  std::string Name() const override { return "TUM RGB-D recording"; }
  std::string Expected() const override {
    return "rgb.txt, associations.txt, or rgb/ with timestamps as names and groundtruth.txt or depth/";
  }
  bool Fits(const std::string& source) const override {
    if (IsFile(source + "/rgb.txt") || FindAssociations(source)) return true;
    return (IsFile(source + "/groundtruth.txt") || IsFolder(source + "/depth")) &&
           !StampedFiles(source + "/rgb").empty();
  }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions& options) const override {
    ROMAP_ASSIGN_OR_RETURN(const TumLists lists, ReadLists(source));
    if (lists.color.empty()) return InvalidArgument("{}: no frames listed", source);
    RecordingContents contents{.source = source};
    ROMAP_RETURN_IF_ERROR(Calibrate(source, lists.color.front().path, options, &contents));
    if (contents.camera.depth_scale == 0) contents.camera.depth_scale = kTumDepthScale;
    for (const files::ListedFile& color : lists.color) {
      RecordedFrame& frame = contents.frames.emplace_back();
      frame.timestamp_ns = color.timestamp_ns;
      SetImage(color.path, &frame);
    }
    SetRateByTimes(&contents);
    std::vector<int64_t> color_ns, depth_ns;
    for (const files::ListedFile& file : lists.color) color_ns.push_back(file.timestamp_ns);
    for (const files::ListedFile& file : lists.depth) depth_ns.push_back(file.timestamp_ns);
    for (const auto& [color, depth] : files::AssociateTimestamps(color_ns, depth_ns, kMaxTumDistance_ns)) {
      SetDepth(lists.depth[depth].path, {}, contents.camera.camera, &contents.frames[color]);
    }
    if (IsFile(source + "/groundtruth.txt")) {
      ROMAP_ASSIGN_OR_RETURN(const std::vector<files::StampedPose> poses, files::ReadTum(source + "/groundtruth.txt"));
      for (RecordedFrame& frame : contents.frames) {
        frame.T_world_camera = files::PoseAt(poses, frame.timestamp_ns, kMaxTumDistance_ns);
      }
    }
    SortByTime(&contents);
    return contents;
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeTumReader() { return std::make_unique<TumReader>(); }

}  // namespace romap::importers
