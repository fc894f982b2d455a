// Runs the object mapper over a recorded sequence with its ground-truth poses and with labels permuted in every frame,
// and compares the cuboids with the sequence's objects.yaml.
//
//   objects_bench DIR [--masks mask_yolo.txt --detections detections_yolo.csv] [--set SECTION.FIELD=VALUE]... [--debug]
//
// Prints for each published object: the nearest true object, IoU, errors, the share of the true surface (points of
// gt/*.ply seen by some camera) inside the cuboid and inside the cuboid enlarged by 10 %, the number of updates and
// views, and the frame of the first cuboid. Also prints the user time per frame and keyframe.

#include <spdlog/spdlog.h>

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "client/files/ply.h"
#include "client/files/sequence.h"
#include "common/config.h"
#include "tests/bench/object_run.h"
#include "tests/support/synthetic_world.h"

namespace romap::measure {
namespace {

const files::ObjectRecord* NearestTrue(const files::Sequence& sequence, const Cuboid& cuboid) {
  const files::ObjectRecord* nearest = nullptr;
  double best = 0;
  if (!sequence.objects()) return nullptr;
  for (const files::ObjectRecord& record : sequence.objects()->objects) {
    const double distance = (record.T_world_object.translation() - cuboid.T_world_object.translation()).norm();
    if (nearest != nullptr && distance >= best) continue;
    nearest = &record;
    best = distance;
  }
  return nearest;
}

// Yaw error modulo a quarter turn, 0..45 degrees: a box has no front.
double YawErrorDeg(const SE3<World, Object>& a, const SE3<World, Object>& b) {
  const Eigen::Vector3d x = (a.rotation().conjugate() * b.rotation()).toRotationMatrix().col(0);
  const double degrees = std::atan2(x.y(), x.x()) * 180 / 3.14159265358979;
  return std::abs(std::remainder(degrees, 90.0));
}

std::vector<Eigen::Vector3d> TrueSurface(const files::Sequence& sequence, const files::ObjectRecord& record) {
  std::vector<Eigen::Vector3d> points;
  std::error_code error;
  for (const auto& file : std::filesystem::directory_iterator(sequence.dir() + "/gt", error)) {
    const std::string name = file.path().stem().string();
    const std::string suffix = "_" + record.name;
    if (name != record.name && !name.ends_with(suffix)) continue;
    const auto ply = files::ReadPly(file.path().string());
    if (!ply.ok()) continue;
    const auto seen = ply->scalars.find("seen");
    for (size_t i = 0; i < ply->mesh.vertices.size(); ++i) {
      if (seen == ply->scalars.end() || seen->second[i] > 0) points.push_back(ply->Position(i));
    }
  }
  return points;
}

void Print(const files::Sequence& sequence, const ObjectRun& run) {
  for (const std::string& line : run.removals) std::printf("%s\n", line.c_str());
  double iou_sum = 0;
  for (const auto& [id, object] : run.objects) {
    const Cuboid& cuboid = object.last.cuboid;
    const Eigen::Vector3d half_cm = 100 * cuboid.half_extents;
    std::printf(
        "%-10s %-13s score %.2f state %d first %3zu seen %3lu updates %2zu boxes %2zu views %2zu half %.1f %.1f %.1f "
        "cm",
        id.ToString().c_str(), object.last.class_name.c_str(), object.last.class_score,
        static_cast<int>(object.last.state), object.first_frame, object.last.observations, object.updates,
        object.cuboid_changes, object.views, half_cm.x(), half_cm.y(), half_cm.z());
    if (const files::ObjectRecord* truth = NearestTrue(sequence, cuboid)) {
      const Cuboid true_cuboid{.T_world_object = truth->T_world_object, .half_extents = truth->half_extents};
      const Eigen::Vector3d true_half_cm = 100 * truth->half_extents;
      const Eigen::Vector3d shift_cm =
          100 * (cuboid.T_world_object.translation() - truth->T_world_object.translation());
      const std::vector<Eigen::Vector3d> surface = TrueSurface(sequence, *truth);
      const double iou = CuboidIou(cuboid, true_cuboid);
      iou_sum += iou;
      std::printf(" | %-9s IoU %.3f shift %4.1f %4.1f %4.1f yaw %4.1f true %.1f %.1f %.1f inside %.3f enlarged %.4f",
                  truth->name.c_str(), iou, shift_cm.x(), shift_cm.y(), shift_cm.z(),
                  YawErrorDeg(cuboid.T_world_object, truth->T_world_object), true_half_cm.x(), true_half_cm.y(),
                  true_half_cm.z(), ContainedShare(cuboid, surface, 1), ContainedShare(cuboid, surface, 1.1));
    }
    std::printf("\n");
  }
  std::printf("%zu objects, mean IoU %.3f; %d frames %.3f ms each, %d keyframes %.2f ms each, slowest %.1f ms (user)\n",
              run.objects.size(), iou_sum / std::max<size_t>(1, run.objects.size()), run.frames,
              1e3 * run.frames_s / run.frames, run.keyframes, 1e3 * run.keyframes_s / run.keyframes,
              1e3 * run.slowest_keyframe_s);
}

int Main(int argc, char** argv) {
  ObjectRunOptions run_options;
  run_options.damage.permute_labels = true;
  ConfigFields fields;
  fields.Section("slam");
  run_options.slam.Fields(fields);
  fields.Section("objects");
  run_options.objects.Fields(fields);
  files::SequenceOptions options;
  std::vector<std::string> assignments;
  std::string dir;
  for (int i = 1; i < argc; ++i) {
    const bool has_value = i + 1 < argc;
    if (std::strcmp(argv[i], "--debug") == 0) {
      spdlog::set_level(spdlog::level::debug);
    } else if (std::strcmp(argv[i], "--masks") == 0 && has_value) {
      options.masks = argv[++i];
    } else if (std::strcmp(argv[i], "--detections") == 0 && has_value) {
      options.detections = argv[++i];
    } else if (std::strcmp(argv[i], "--set") == 0 && has_value) {
      assignments.emplace_back(argv[++i]);
    } else {
      dir = argv[i];
    }
  }
  if (absl::Status status = fields.Load("", assignments); !status.ok()) {
    std::fprintf(stderr, "%s\n", Message(status).c_str());
    return 2;
  }
  const auto sequence = files::Sequence::Open(dir, options);
  if (!sequence.ok()) {
    std::fprintf(stderr, "%s\n", Message(sequence.status()).c_str());
    return 2;
  }
  const auto run = RunObjects(*sequence, run_options);
  if (!run.ok()) {
    std::fprintf(stderr, "%s\n", Message(run.status()).c_str());
    return 1;
  }
  Print(*sequence, *run);
  return 0;
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) { return romap::measure::Main(argc, argv); }
