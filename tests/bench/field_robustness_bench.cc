// Measures the effect of wrong input on fields: trains the objects of a sequence with true cuboids, poses and masks,
// except for the damage of a scenario, and writes the meshes for `romap eval objects`:
//   field_robustness_bench SEQUENCE OUT [--scenario NAME ..] [--set nerf.FIELD=VALUE ..] [--every 4] [--offset 0]
//                          [--seed 1] [--threads 2] [--depth]
// Meshes are written to OUT/<scenario>/objects. Scenarios: clean; pose (one view is rotated by 5 degrees about its
// vertical axis); mask (one view has the mask of another object); black (one view is black); depth_scale (depths are 20
// % too large); depth_noise (a third of the depths is missing, a tenth is random); arrivals (views arrive one by one
// during training).
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "client/bench/true_views.h"
#include "client/files/ply.h"
#include "client/files/sequence.h"
#include "common/angles.h"
#include "common/status.h"
#include "server/mesh/extract_mesh.h"
#include "server/nerf/object_field.h"
#include "tests/bench/run_configured.h"

namespace romap::measure {
namespace {

struct Options {
  std::string sequence, out;
  std::vector<std::string> assignments, scenarios;
  int every = 4, offset = 0, seed = 1, threads = 2;
  bool depth = false;
  nerf::NerfConfig nerf;
  mesh::MeshConfig mesh;
};

using Views = std::vector<ObjectView>;
// Damages the views of one object. `other`: the views of another object.
using Damage = std::function<void(Views& views, const Views& other)>;

void RotateOneView(Views& views, const Views&) {
  ObjectView& view = views[views.size() / 2];
  const Eigen::AngleAxisd turn(5 * kRadPerDeg, Eigen::Vector3d::UnitY());
  view.T_world_camera = view.T_world_camera * SE3<Camera, Camera>(Eigen::Quaterniond(turn), Eigen::Vector3d::Zero());
}

void SwapMaskOfOneView(Views& views, const Views& other) {
  ObjectView& view = views[views.size() / 2];
  for (const ObjectView& wrong : other) {
    if (wrong.keyframe != view.keyframe) continue;
    const ObjectId object = view.object;
    view = wrong;
    view.object = object;
  }
}

void BlackenOneView(Views& views, const Views&) {
  ObjectView& view = views[views.size() / 2];
  view.color_bgr = cv::Mat::zeros(view.color_bgr.size(), CV_8UC3);
}

void ScaleDepth(Views& views, const Views&) {
  for (ObjectView& view : views) {
    if (!view.depth_mu.empty()) view.depth_mu = view.depth_mu * 1.2;
  }
}

void AddDepthNoise(Views& views, const Views&) {
  cv::RNG random(1);
  for (ObjectView& view : views) {
    for (int y = 0; y < view.depth_mu.rows; ++y) {
      for (int x = 0; x < view.depth_mu.cols; ++x) {
        float& z_mu = view.depth_mu.at<float>(y, x);
        const float draw = random.uniform(0.0f, 1.0f);
        if (draw < 0.33f) z_mu = draw < 0.1f ? NAN : 0;
        if (draw > 0.9f) z_mu *= random.uniform(0.3f, 3.0f);
      }
    }
  }
}

const std::map<std::string, Damage> kScenarios = {{"clean", [](Views&, const Views&) {}},
                                                  {"pose", RotateOneView},
                                                  {"mask", SwapMaskOfOneView},
                                                  {"black", BlackenOneView},
                                                  {"depth_scale", ScaleDepth},
                                                  {"depth_noise", AddDepthNoise},
                                                  {"arrivals", [](Views&, const Views&) {}}};

absl::Status WriteMesh(const FieldSnapshot& snapshot, const files::ObjectRecord& object, const std::string& dir,
                       const mesh::MeshConfig& config) {
  ROMAP_ASSIGN_OR_RETURN(Mesh mesh, mesh::ExtractMesh(snapshot, config));
  for (Eigen::Vector3f& v : mesh.vertices) v = (snapshot.T_world_object * v.cast<double>()).cast<float>();
  for (Eigen::Vector3f& n : mesh.normals) n = (snapshot.T_world_object.rotation() * n.cast<double>()).cast<float>();
  std::filesystem::create_directories(dir);
  return files::WritePly(fmt::format("{}/{}_{}.ply", dir, object.id, object.name), mesh);
}

// Trains all allowed steps in slices, as the training pool does.
void TrainAllowed(nerf::ObjectField& field, bool complete, const Options& options) {
  while (field.AllowedSteps(complete) > field.steps()) {
    const uint64_t left = field.AllowedSteps(complete) - field.steps();
    field.Train(static_cast<int>(std::min<uint64_t>(left, static_cast<uint64_t>(options.nerf.slice_steps))),
                options.threads);
  }
}

absl::Status TrainObject(const files::ObjectRecord& object, const Views& views, const std::string& scenario,
                         const Options& options) {
  nerf::ObjectField field(options.nerf, ObjectId{static_cast<uint64_t>(object.id)},
                          static_cast<uint64_t>(options.seed));
  ROMAP_RETURN_IF_ERROR(field.SetBox({object.T_world_object, object.half_extents, 1.0}));
  for (const ObjectView& view : views) {
    if (const absl::Status status = field.AddView(view); !status.ok()) std::printf("%s\n", Message(status).c_str());
    if (scenario == "arrivals") TrainAllowed(field, false, options);
  }
  TrainAllowed(field, true, options);
  const FieldSnapshot snapshot = field.Snapshot();
  std::printf("%-12s %-10s %5d views %6llu steps %7.3f s  loss %.4f\n", scenario.c_str(), object.name.c_str(),
              field.views(), static_cast<unsigned long long>(field.steps()), snapshot.train_seconds, snapshot.loss);
  std::fflush(stdout);
  return WriteMesh(snapshot, object, options.out + "/" + scenario + "/objects", options.mesh);
}

absl::Status Run(const Options& options) {
  ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence,
                         files::Sequence::Open(options.sequence, {.use_depth = options.depth}));
  ROMAP_ASSIGN_OR_RETURN(const bench::TrueFrames frames,
                         bench::LoadTrueFrames(sequence, options.every, options.offset));
  const std::vector<files::ObjectRecord>& objects = sequence.objects()->objects;
  for (const std::string& scenario : options.scenarios) {
    for (size_t i = 0; i < objects.size(); ++i) {
      const auto views_of = [&](const files::ObjectRecord& object) {
        return bench::MakeTrueViews(frames, object, options.depth);
      };
      Views views = views_of(objects[i]);
      if (views.empty()) continue;
      kScenarios.at(scenario)(views, views_of(objects[(i + 1) % objects.size()]));
      ROMAP_RETURN_IF_ERROR(TrainObject(objects[i], views, scenario, options));
    }
  }
  return absl::OkStatus();
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) {
  romap::measure::Options options;
  CLI::App app("Trains fields on wrong input");
  std::vector<std::string> names;
  for (const auto& [name, damage] : romap::measure::kScenarios) names.push_back(name);
  options.scenarios = names;
  app.add_option("sequence", options.sequence)->required();
  app.add_option("out", options.out)->required();
  app.add_option("--scenario", options.scenarios)->check(CLI::IsMember(names));
  app.add_option("--set", options.assignments)->allow_extra_args(false);
  app.add_option("--every", options.every)->check(CLI::PositiveNumber);
  app.add_option("--offset", options.offset)->check(CLI::NonNegativeNumber);
  app.add_option("--threads", options.threads);
  app.add_option("--seed", options.seed);
  app.add_flag("--depth", options.depth);
  CLI11_PARSE(app, argc, argv);
  return romap::measure::RunConfigured(options, romap::measure::Run);
}
