// Trains the objects of a sequence with true cuboids, poses and masks, and prints the cost:
//   field_bench SEQUENCE [OUT] [--set nerf.FIELD=VALUE ..] [--every 4] [--offset 0] [--steps 0] [--threads 2]
//               [--loosen 0] [--seed 1] [--depth] [--masks mask.txt]
//               [--first-steps 0] [--first-scale 1 1 1] [--first-yaw-deg 0]
//               [--pose-noise-deg 0] [--pose-noise-cm 0] [--mask-noise-px 0] [--noise-seed 1]
// Every `every`-th frame becomes a view. `loosen` 0.2 makes the cuboids 20 % longer. `steps` 0 = all planned steps.
// `first-steps` are done in a wrong box, scaled along its axes from its lowest corner and rotated, before the correct
// box replaces it; then the rows show the last step in the wrong box, the first step in the correct one, and the
// remaining steps. The noise applies to every view: see frame_noise.h. With OUT, meshes are written to
// OUT/objects/<id>_<name>.ply in the World frame, for `romap eval objects`.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "client/bench/true_views.h"
#include "client/files/ply.h"
#include "client/files/sequence.h"
#include "common/angles.h"
#include "server/mesh/extract_mesh.h"
#include "server/nerf/object_field.h"
#include "tests/bench/frame_noise.h"
#include "tests/bench/run_configured.h"

namespace romap::measure {
namespace {

struct Options {
  std::string sequence;
  std::string out;
  std::string masks = "mask.txt";
  std::vector<std::string> assignments;
  int every = 4;
  int offset = 0;
  int steps = 0;
  int threads = 2;
  int seed = 1;
  double loosen = 0;
  int first_steps = 0;
  std::vector<double> first_scale = {1, 1, 1};
  double first_yaw_deg = 0;
  bool depth = false;
  FrameNoise noise;
  nerf::NerfConfig nerf;
  mesh::MeshConfig mesh;
};

absl::Status WriteMesh(const FieldSnapshot& snapshot, const files::ObjectRecord& object, const Options& options) {
  ROMAP_ASSIGN_OR_RETURN(Mesh mesh, mesh::ExtractMesh(snapshot, options.mesh));
  for (Eigen::Vector3f& v : mesh.vertices) v = (snapshot.T_world_object * v.cast<double>()).cast<float>();
  for (Eigen::Vector3f& n : mesh.normals) n = (snapshot.T_world_object.rotation() * n.cast<double>()).cast<float>();
  const std::string dir = options.out + "/objects";
  std::filesystem::create_directories(dir);
  return files::WritePly(fmt::format("{}/{}_{}.ply", dir, object.id, object.name), mesh);
}

void PrintRow(const std::string& name, int views, const nerf::TrainStats& stats, double setup_s) {
  const double samples = static_cast<double>(std::max<uint64_t>(1, stats.samples));
  std::printf("%-10s %5d %5d %8.3f %8.3f %8.3f %7.2f %6.2f %7.4f |", name.c_str(), views, stats.steps, setup_s,
              stats.CpuSeconds(), stats.wall_s, samples / stats.CpuSeconds() * 1e-6,
              static_cast<double>(stats.active_samples) / samples, stats.color_loss);
  for (double s : stats.phase_cpu_s) std::printf(" %11.1f", s / samples * 1e9);
  std::printf("\n");
  std::fflush(stdout);
}

// The box of the first steps.
Cuboid FirstBox(const files::ObjectRecord& object, const Options& options) {
  const Eigen::Vector3d scale(options.first_scale[0], options.first_scale[1], options.first_scale[2]);
  const Eigen::Vector3d half = object.half_extents.cwiseProduct(scale);
  const Eigen::AngleAxisd turn(options.first_yaw_deg * kRadPerDeg, Eigen::Vector3d::UnitZ());
  const SE3<Object, Object> T_object_first(Eigen::Quaterniond(turn), half - object.half_extents);
  return {object.T_world_object * T_object_first, half, 1.0};
}

absl::Status BenchObject(const bench::TrueFrames& frames, files::ObjectRecord object, const Options& options) {
  object.half_extents *= 1.0 + options.loosen;
  nerf::ObjectField field(options.nerf, ObjectId{static_cast<uint64_t>(object.id)},
                          static_cast<uint64_t>(options.seed));
  const Cuboid correct{object.T_world_object, object.half_extents, 1.0};
  ROMAP_RETURN_IF_ERROR(field.SetBox(options.first_steps > 0 ? FirstBox(object, options) : correct));
  const auto start = std::chrono::steady_clock::now();
  for (ObjectView& view : bench::MakeTrueViews(frames, object, options.depth)) {
    ROMAP_RETURN_IF_ERROR(field.AddView(std::move(view)));
  }
  if (field.views() == 0) return absl::OkStatus();
  double setup_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (options.first_steps > 0) {
    if (options.first_steps > 1) field.Train(options.first_steps - 1, options.threads);
    PrintRow("wrong box", field.views(), field.Train(1, options.threads), setup_s);
    const auto change = std::chrono::steady_clock::now();
    ROMAP_RETURN_IF_ERROR(field.SetBox(correct));
    setup_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - change).count();
    PrintRow("correct box", field.views(), field.Train(1, options.threads), setup_s);
  }
  const int steps = options.steps > 0 ? options.steps : static_cast<int>(field.AllowedSteps(true) - field.steps());
  PrintRow(object.name, field.views(), field.Train(steps, options.threads), setup_s);
  return options.out.empty() ? absl::OkStatus() : WriteMesh(field.Snapshot(), object, options);
}

absl::Status Run(const Options& options) {
  files::SequenceOptions sequence_options{.masks = options.masks, .use_depth = options.depth};
  ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence, files::Sequence::Open(options.sequence, sequence_options));
  ROMAP_ASSIGN_OR_RETURN(const bench::TrueFrames true_frames,
                         bench::LoadTrueFrames(sequence, options.every, options.offset));
  const bench::TrueFrames frames = WithNoise(true_frames, options.noise);
  std::printf("%-10s %5s %5s %8s %8s %8s %7s %6s %7s |", "object", "views", "steps", "setup s", "cpu s", "wall s",
              "Msam/s", "active", "loss");
  for (const char* name : nerf::kTrainPhaseNames) std::printf(" %11s", name);
  std::printf("  [ns/sample]\n");
  for (const files::ObjectRecord& object : sequence.objects()->objects) {
    ROMAP_RETURN_IF_ERROR(BenchObject(frames, object, options));
  }
  return absl::OkStatus();
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) {
  romap::measure::Options options;
  CLI::App app("Trains the objects of a sequence and prints the cost");
  app.add_option("sequence", options.sequence)->required();
  app.add_option("out", options.out);
  app.add_option("--set", options.assignments)->allow_extra_args(false);
  app.add_option("--masks", options.masks);
  app.add_option("--every", options.every)->check(CLI::PositiveNumber);
  app.add_option("--offset", options.offset)->check(CLI::NonNegativeNumber);
  app.add_option("--steps", options.steps);
  app.add_option("--threads", options.threads);
  app.add_option("--seed", options.seed);
  app.add_option("--loosen", options.loosen);
  app.add_option("--first-steps", options.first_steps);
  app.add_option("--first-scale", options.first_scale)->expected(3);
  app.add_option("--first-yaw-deg", options.first_yaw_deg);
  app.add_flag("--depth", options.depth);
  app.add_option("--pose-noise-deg", options.noise.pose_deg)->check(CLI::NonNegativeNumber);
  app.add_option("--pose-noise-cm", options.noise.pose_cm)->check(CLI::NonNegativeNumber);
  app.add_option("--mask-noise-px", options.noise.mask_px)->check(CLI::NonNegativeNumber);
  app.add_option("--noise-seed", options.noise.seed);
  CLI11_PARSE(app, argc, argv);
  return romap::measure::RunConfigured(options, romap::measure::Run);
}
