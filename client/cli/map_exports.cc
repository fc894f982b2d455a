#include "client/cli/map_exports.h"

#include <algorithm>
#include <filesystem>

#include "client/exports/colmap.h"
#include "client/exports/kitti.h"
#include "client/exports/nerfstudio.h"
#include "client/exports/usd.h"
#include "client/files/mapped_frames.h"

namespace romap::cli {
namespace {

// Of each object, for tools that start with points.
constexpr size_t kPointsPerObject = 2000;

std::vector<exports::ColoredPoint> ExportedPoints(const std::vector<MapObject>& objects) {
  std::vector<exports::ColoredPoint> points;
  for (const MapObject& entry : objects) {
    const auto more = exports::PointsOf(entry.mesh, entry.S_world_mesh, kPointsPerObject);
    points.insert(points.end(), more.begin(), more.end());
  }
  return points;
}

}  // namespace

absl::Status WriteExports(const std::string& dir, const std::vector<std::string>& formats,
                          const std::vector<MapObject>& objects, const std::vector<files::StampedPose>& trajectory,
                          const files::Sequence* sequence) {
  const auto wants = [&](const char* format) { return std::ranges::find(formats, format) != formats.end(); };
  const std::filesystem::path out(dir);
  if (wants("kitti")) {
    ROMAP_RETURN_IF_ERROR(exports::WriteKitti((out / "trajectory_kitti.txt").string(), trajectory));
  }
  if (wants("usd")) {
    std::vector<exports::UsdObject> usd;
    for (const MapObject& entry : objects) {
      usd.push_back({.name = entry.file_stem,
                     .class_name = entry.object.class_name,
                     .mesh = &entry.mesh,
                     .texture = &entry.texture,
                     .S_world_mesh = entry.S_world_mesh});
    }
    ROMAP_RETURN_IF_ERROR(exports::WriteUsd((out / "map.usda").string(), usd));
  }
  if (!wants("nerfstudio") && !wants("colmap")) return absl::OkStatus();
  if (sequence == nullptr) {
    return FailedPrecondition("--as nerfstudio and --as colmap need the images: name the recording with --sequence");
  }
  const std::string folder = (out / "dataset").string();
  ROMAP_ASSIGN_OR_RETURN(const auto images,
                         exports::WritePosedImages(folder, *sequence, files::MappedFrames(*sequence, trajectory)));
  const std::vector<exports::ColoredPoint> points = ExportedPoints(objects);
  if (wants("nerfstudio")) {
    ROMAP_RETURN_IF_ERROR(exports::WriteNerfstudio(folder, sequence->camera(), images, points));
  }
  if (wants("colmap")) ROMAP_RETURN_IF_ERROR(exports::WriteColmap(folder, sequence->camera(), images, points));
  return absl::OkStatus();
}

}  // namespace romap::cli
