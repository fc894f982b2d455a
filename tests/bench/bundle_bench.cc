// Measures bundle adjustment on synthetic maps.
//
//   bundle_bench [REPEATS]
//
// Prints, for each problem size and solver, the shortest user time of REPEATS (default 5) runs, the number of
// iterations, and the errors before and after.

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/bench/user_seconds.h"
#include "tests/unit/server/slam/optimize/bundle_world.h"

namespace romap::measure {
namespace {

void Measure(const std::string& name, const slam::BundleWorldOptions& world_options, const slam::BundleOptions& options,
             int repeats) {
  const slam::BundleWorld world = slam::MakeBundleWorld(world_options);
  slam::BundleSummary summary;
  double shortest_s = 1e300;
  for (int i = 0; i < repeats; ++i) {
    slam::BundleProblem problem = world.problem;
    const double start_s = UserSeconds();
    summary = slam::AdjustBundle(problem, options);
    shortest_s = std::min(shortest_s, UserSeconds() - start_s);
  }
  fmt::print("{:<28} {:4d} cameras {:6d} points {:7d} observations {:8.1f} ms {:3d} iterations {:7.2f} -> {:5.2f} px\n",
             name, world.problem.cameras.size(), world.problem.points.size(), world.problem.observations.size(),
             1e3 * shortest_s, summary.iterations, summary.initial_rms_px, summary.final_rms_px);
}

slam::BundleWorldOptions Window(int cameras, int fixed_cameras, int points, int observations) {
  slam::BundleWorldOptions options;
  options.cameras = cameras;
  options.fixed_cameras = fixed_cameras;
  options.points = points;
  options.observations_per_point = observations;
  options.step_rad = 0.05;
  options.pixel_noise_px = 1;
  options.pose_noise_rad = 0.002;
  options.pose_noise_mu = 0.01;
  options.point_noise_mu = 0.02;
  options.outlier_share = 0.03;
  return options;
}

void MeasureAll(int repeats) {
  slam::BundleOptions local;
  local.dense = true;
  local.max_iterations = 8;
  slam::BundleOptions local_sparse = local;
  local_sparse.dense = false;
  // With eight observations per point, the seven cameras before the free ones share points with them.
  for (const int points : {1000, 1500, 2500}) {
    for (const int free : {10, 20}) {
      const slam::BundleWorldOptions window = Window(free + 7, 7, points, 8);
      Measure(fmt::format("window {} free, dense", free), window, local, repeats);
      Measure(fmt::format("window {} free, sparse", free), window, local_sparse, repeats);
    }
  }
  slam::BundleWorldOptions depth = Window(17, 7, 1500, 8);
  depth.with_depth = true;
  Measure("window with depth, dense", depth, local, repeats);

  slam::BundleOptions global;
  global.max_iterations = 20;
  slam::BundleWorldOptions whole = Window(200, 2, 15000, 7);
  whole.step_rad = 0.03;
  Measure("whole map, sparse", whole, global, std::min(repeats, 2));
  global.dense = true;
  Measure("whole map, dense", whole, global, std::min(repeats, 2));
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) {
  romap::measure::MeasureAll(argc > 1 ? std::max(1, std::atoi(argv[1])) : 5);
  return 0;
}
