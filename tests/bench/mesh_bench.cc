// Measures the time to extract a mesh from a trained field, by phase:
//   mesh_bench [SEQUENCE] [--set nerf.FIELD=VALUE --set mesh.FIELD=VALUE ..] [--steps 200] [--repeats 7] [--final]
// Trains each object of SEQUENCE (true cuboids, poses and masks; every fourth frame) or, without SEQUENCE, of a
// synthetic world. Then extracts its mesh `repeats` times on one thread and reports the fastest run. "all nodes" is the
// time to evaluate the field at all mesh.resolution^3 nodes of a cube, a lower bound for extraction without sparse
// sampling; only the ratio to it is comparable between machines and runs. "signs" is the share of the nodes inside the
// hull that sampling put on the wrong side of the surface. --final: meshes as of a field whose training is complete.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "client/files/sequence.h"
#include "common/status.h"
#include "server/mesh/extract_mesh.h"
#include "server/mesh/sample_field.h"
#include "server/mesh/surface_probe.h"
#include "server/nerf/object_field.h"
#include "tests/bench/run_configured.h"
#include "tests/bench/training_scene.h"

namespace romap::measure {
namespace {

struct Options {
  std::string sequence;
  std::vector<std::string> assignments;
  int steps = 200;
  int repeats = 7;
  bool final = false;
  nerf::NerfConfig nerf;
  mesh::MeshConfig mesh;
};

double Milliseconds(std::chrono::steady_clock::duration time) {
  return std::chrono::duration<double, std::milli>(time).count();
}

// Time to evaluate the field at all nodes of a cube.
double AllNodesMilliseconds(const FieldSnapshot& snapshot, int resolution) {
  const mesh::FieldGrid grid = mesh::MakeEmptyGrid(Eigen::Vector3i::Constant(resolution), snapshot.box_half_extents);
  std::vector<Eigen::Vector3f> points;
  for (int z = 1; z <= resolution; ++z) {
    for (int y = 1; y <= resolution; ++y) {
      for (int x = 1; x <= resolution; ++x) points.push_back(grid.Position(Eigen::Vector3i(x, y, z).cast<float>()));
    }
  }
  std::vector<float> raw(points.size());
  const auto start = std::chrono::steady_clock::now();
  snapshot.field->Sample(points, raw, {});
  return Milliseconds(std::chrono::steady_clock::now() - start);
}

// Share of the nodes inside the hull that sampling put on the wrong side of the surface.
double WrongSigns(const FieldSnapshot& snapshot, const Eigen::Vector3i& nodes) {
  const mesh::SurfaceProbe probe(snapshot);
  const mesh::FieldGrid grid = mesh::SampleField(snapshot, probe, nodes).grid;
  std::vector<Eigen::Vector3f> points;
  std::vector<bool> inside;
  for (size_t node = 0; node < grid.value.size(); ++node) {
    if (grid.value[node] <= mesh::kEmpty || grid.edited[node] != 0) continue;
    points.push_back(grid.Position(grid.NodeAt(node)));
    inside.push_back(grid.value[node] > 0);
  }
  std::vector<float> values(points.size());
  probe.Sample(points, values);
  size_t wrong = 0;
  for (size_t i = 0; i < values.size(); ++i) wrong += inside[i] != (values[i] > 0);
  return static_cast<double>(wrong) / static_cast<double>(std::max<size_t>(1, values.size()));
}

absl::Status BenchObject(const TrainingScene& scene, const files::ObjectRecord& object, const Options& options) {
  nerf::ObjectField field(options.nerf, ObjectId{static_cast<uint64_t>(object.id)}, 1);
  ROMAP_RETURN_IF_ERROR(field.SetBox({object.T_world_object, object.half_extents, 1.0}));
  for (ObjectView& view : bench::MakeTrueViews(scene.frames, object, /*with_depth=*/false)) {
    ROMAP_RETURN_IF_ERROR(field.AddView(std::move(view)));
  }
  if (field.views() == 0) return absl::OkStatus();
  field.Train(options.steps, 2);
  FieldSnapshot snapshot = field.Snapshot();
  snapshot.converged = options.final;

  mesh::MeshStats best;
  double best_s = std::numeric_limits<double>::infinity();
  double all_nodes_ms = best_s;
  Mesh mesh;
  for (int repeat = 0; repeat < options.repeats; ++repeat) {
    mesh::MeshStats stats;
    ROMAP_ASSIGN_OR_RETURN(mesh, mesh::ExtractMesh(snapshot, options.mesh, &stats));
    const double total_s = std::accumulate(stats.phase_cpu_s.begin(), stats.phase_cpu_s.end(), 0.0);
    if (total_s < best_s) best = stats;
    best_s = std::min(best_s, total_s);
    all_nodes_ms = std::min(all_nodes_ms, AllNodesMilliseconds(snapshot, options.mesh.resolution));
  }
  const Eigen::Vector3i& nodes = best.nodes;
  std::printf("%-10s %3dx%3dx%3d %8zu %8zu %6.3f%% |", object.name.c_str(), nodes.x(), nodes.y(), nodes.z(),
              best.sampled_nodes, mesh.vertices.size(), 100 * WrongSigns(snapshot, nodes));
  for (const double phase_s : best.phase_cpu_s) std::printf(" %10.2f", 1e3 * phase_s);
  std::printf(" | %7.2f %9.2f %6.2f\n", 1e3 * best_s, all_nodes_ms, 1e3 * best_s / all_nodes_ms);
  std::fflush(stdout);
  return absl::OkStatus();
}

absl::Status Run(const Options& options) {
  ROMAP_ASSIGN_OR_RETURN(const TrainingScene scene, LoadTrainingScene(options.sequence));
  std::printf("%-10s %11s %8s %8s %7s |", "object", "nodes", "sampled", "vertices", "signs");
  for (const char* name : mesh::kMeshPhaseNames) std::printf(" %10s", name);
  std::printf(" | %7s %9s %6s  [ms]\n", "sum", "all nodes", "ratio");
  for (const files::ObjectRecord& object : scene.objects) ROMAP_RETURN_IF_ERROR(BenchObject(scene, object, options));
  return absl::OkStatus();
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) {
  romap::measure::Options options;
  CLI::App app("Measures the time to extract meshes from trained fields");
  app.add_option("sequence", options.sequence);
  app.add_option("--set", options.assignments)->allow_extra_args(false);
  app.add_option("--steps", options.steps)->check(CLI::PositiveNumber);
  app.add_option("--repeats", options.repeats)->check(CLI::PositiveNumber);
  app.add_flag("--final", options.final);
  CLI11_PARSE(app, argc, argv);
  return romap::measure::RunConfigured(options, romap::measure::Run);
}
