#include "client/cli/map_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "client/cli/cuboid_outline.h"
#include "client/cli/frame_image.h"
#include "client/cli/mesh_instance.h"
#include "client/files/mapped_frames.h"
#include "client/files/text_file.h"
#include "client/pictures/pictures.h"

namespace romap::cli {
namespace {

namespace fs = std::filesystem;
constexpr size_t kCuboidFrames = 6;  // evenly spaced over the sequence

// The frame in which the cuboid is largest; nullopt if it is never completely visible.
std::optional<files::PosedFrame> BestView(const Cuboid& cuboid, const CameraModel& camera,
                                          const std::vector<files::PosedFrame>& frames) {
  double best_area_px = 0;
  std::optional<files::PosedFrame> best;
  for (const files::PosedFrame& frame : frames) {
    const auto outline = CuboidOutline(cuboid, camera, frame.T_world_camera);
    if (outline && outline->area() > best_area_px) {
      best_area_px = outline->area();
      best = frame;
    }
  }
  return best;
}

// The extension of `path` selects the format.
absl::Status WriteImage(const fs::path& path, const cv::Mat& image) {
  std::vector<uchar> bytes;
  if (!cv::imencode(path.extension().string(), image, bytes)) return Internal("{}: cannot encode", path.string());
  return files::WriteFile(path.string(), std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

}  // namespace

absl::Status WriteMapPictures(const std::string& dir, const files::Sequence& sequence,
                              const std::vector<files::StampedPose>& trajectory,
                              const std::vector<MapObject>& objects) {
  const fs::path folder = fs::path(dir) / "pictures";
  std::error_code error;
  fs::remove_all(folder, error);
  ROMAP_RETURN_IF_ERROR(files::MakeFolder(folder.string()));

  const std::vector<files::PosedFrame> frames = files::MappedFrames(sequence, trajectory);
  CameraModel camera = sequence.camera();
  std::vector<ObjectUpdate> updates;
  for (const MapObject& entry : objects) {
    updates.push_back(entry.object);
    const std::optional<files::PosedFrame> view = BestView(entry.object.cuboid, camera, frames);
    if (!view) continue;
    ROMAP_ASSIGN_OR_RETURN(const FrameImage image, LoadFrameImage(sequence, view->index));
    ROMAP_RETURN_IF_ERROR(WriteImage(folder / (entry.file_stem + ".png"),
                                     pictures::DrawMeshBesideView(InstanceOf(entry), image.color_bgr, camera,
                                                                  view->T_world_camera, &entry.object.cuboid)));
  }
  std::vector<render::MeshInstance> meshes;
  for (const MapObject& entry : objects) meshes.push_back(InstanceOf(entry));
  const Eigen::Vector3d up_world =
      objects.empty() ? Eigen::Vector3d(Eigen::Vector3d::UnitZ())
                      : objects.front().object.cuboid.T_world_object.rotation() * Eigen::Vector3d::UnitZ();
  ROMAP_RETURN_IF_ERROR(WriteImage(folder / "map.png", pictures::DrawOverview(meshes, updates, up_world)));
  return WriteCuboidPictures(folder.string(), sequence, trajectory, updates);
}

absl::Status WriteCuboidPictures(const std::string& folder, const files::Sequence& sequence,
                                 const std::vector<files::StampedPose>& trajectory,
                                 std::span<const ObjectUpdate> objects) {
  ROMAP_RETURN_IF_ERROR(files::MakeFolder(folder));
  const std::vector<files::PosedFrame> frames = files::MappedFrames(sequence, trajectory);
  const size_t count = std::min(kCuboidFrames, frames.size());
  for (size_t i = 0; i < count; ++i) {
    const files::PosedFrame& frame = frames[(2 * i + 1) * frames.size() / (2 * count)];
    ROMAP_ASSIGN_OR_RETURN(FrameImage image, LoadFrameImage(sequence, frame.index));
    pictures::DrawCuboids(image.color_bgr, sequence.camera(), frame.T_world_camera, objects);
    const std::string name = fmt::format("cuboids_{:06d}.jpg", frame.index + 1);
    ROMAP_RETURN_IF_ERROR(WriteImage(fs::path(folder) / name, image.color_bgr));
  }
  return absl::OkStatus();
}

}  // namespace romap::cli
