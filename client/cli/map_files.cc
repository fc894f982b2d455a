#include "client/cli/map_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <iterator>
#include <string_view>
#include <utility>

#include "client/files/glb.h"
#include "client/files/obj_write.h"
#include "client/files/objects_yaml.h"
#include "client/files/ply.h"
#include "client/files/text_file.h"
#include "common/mesh_codec.h"

namespace romap::cli {
namespace {

namespace fs = std::filesystem;

std::string FileStem(const ObjectUpdate& object) {
  std::string stem = fmt::format("{}_", object.id.value);
  for (const char c : object.class_name) {
    stem += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' ? c : '_';
  }
  return stem;
}

// Of meshes, and of the materials and textures beside them.
constexpr std::string_view kMeshExtensions[] = {".ply", ".glb", ".obj", ".mtl", ".jpg", ".png"};

// Creates a folder and removes the meshes in it.
absl::Status MakeMeshFolder(const fs::path& folder) {
  ROMAP_RETURN_IF_ERROR(files::MakeFolder(folder.string()));
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string extension = entry.path().extension().string();
    if (std::ranges::find(kMeshExtensions, extension) != std::end(kMeshExtensions)) fs::remove(entry.path(), error);
  }
  return absl::OkStatus();
}

}  // namespace

std::vector<MapObject> DecodeObjects(const std::vector<ObjectSnapshot>& objects, std::vector<std::string>* faults) {
  std::vector<MapObject> decoded;
  for (const ObjectSnapshot& snapshot : objects) {
    if (snapshot.object.state == ObjectState::kProvisional) continue;
    MapObject entry;
    entry.object = snapshot.object;
    entry.file_stem = FileStem(snapshot.object);
    if (snapshot.mesh) {
      entry.train_seconds = snapshot.mesh->train_seconds;
      entry.steps = snapshot.mesh->steps;
      entry.next_view = snapshot.mesh->next_view;
      if (auto mesh = DecodeDraco(snapshot.mesh->draco); mesh.ok()) {
        const SE3<World, Object> T_world_mesh =
            snapshot.object.T_world_mesh.value_or(snapshot.object.cuboid.T_world_object);
        entry.mesh = *std::move(mesh);
        if (!entry.mesh.uv.empty()) entry.texture = snapshot.mesh->texture;
        entry.S_world_mesh = {snapshot.object.mesh_scale, T_world_mesh.rotation(), T_world_mesh.translation()};
      } else {
        faults->push_back(
            fmt::format("{}: cannot decode the mesh: {}", snapshot.object.id.ToString(), Message(mesh.status())));
      }
    }
    decoded.push_back(std::move(entry));
  }
  return decoded;
}

std::vector<files::StampedPose> TrajectoryOf(const MapSnapshot& snapshot) {
  std::vector<files::StampedPose> trajectory;
  for (size_t i = 0; i < snapshot.trajectory.size(); ++i) {
    if (snapshot.trajectory[i].T_world_camera) {
      const FrameAck& frame = snapshot.trajectory[i];
      trajectory.push_back({snapshot.timestamps_ns[i], *frame.T_world_camera, frame.uncertainty});
    }
  }
  return trajectory;
}

void MapFileOptions::AddTo(CLI::App& command) {
  command.add_flag("--obj", obj, "Write an OBJ file with material and texture for each object, too");
  command
      .add_option("--as", formats,
                  "Write the map for other tools, too: nerfstudio and colmap (images with the poses of the map, in "
                  "OUT/dataset), kitti (OUT/trajectory_kitti.txt), usd (OUT/map.usda); several are separated by commas")
      ->delimiter(',')
      ->check(CLI::IsMember({"nerfstudio", "colmap", "kitti", "usd"}))
      ->option_text("FORMAT,...");
}

absl::Status WriteMapFiles(const std::string& dir, const std::vector<MapObject>& objects,
                           const MapFileOptions& options) {
  const fs::path folder = fs::path(dir) / "objects";
  ROMAP_RETURN_IF_ERROR(MakeMeshFolder(folder));
  files::ObjectsYaml cuboids;
  for (const MapObject& entry : objects) {
    const ObjectUpdate& object = entry.object;
    cuboids.up_world = object.cuboid.T_world_object.rotation() * Eigen::Vector3d::UnitZ();
    cuboids.objects.push_back({.id = static_cast<int64_t>(object.id.value),
                               .name = entry.file_stem,
                               .class_name = object.class_name,
                               .T_world_object = object.cuboid.T_world_object,
                               .half_extents = object.cuboid.half_extents,
                               .confidence = object.cuboid.confidence});
    if (entry.mesh.triangles.empty()) continue;
    const std::string stem = (folder / entry.file_stem).string();
    ROMAP_RETURN_IF_ERROR(files::WriteWorldPly(stem + ".ply", entry.mesh, entry.S_world_mesh));
    ROMAP_RETURN_IF_ERROR(files::WriteGlb(stem + ".glb", entry.mesh, entry.S_world_mesh, entry.texture));
    if (options.obj) {
      ROMAP_RETURN_IF_ERROR(files::WriteObj(stem + ".obj", entry.mesh, entry.S_world_mesh, entry.texture));
    }
  }
  return files::WriteObjects((fs::path(dir) / "cuboids.json").string(), cuboids);
}

}  // namespace romap::cli
