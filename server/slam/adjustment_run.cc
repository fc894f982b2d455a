#include "server/slam/adjustment_run.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <exception>
#include <system_error>
#include <utility>

#include "common/thread_priority.h"

namespace romap::slam {

AdjustmentRun::AdjustmentRun(MapProblem problem, Solver solver, bool run_inline, int nice)
    : problem_(std::move(problem)), solver_(std::move(solver)) {
  if (run_inline) {
    Solve();
  } else {
    try {
      thread_ = std::thread([this, nice] {
        LowerThreadPriority(nice);
        Solve();
      });
    } catch (const std::system_error& e) {  // no more threads
      spdlog::warn("slam: an adjustment was given up: {}", e.what());
      finished_ = true;
    }
  }
}

AdjustmentRun::~AdjustmentRun() {
  abort_ = true;
  if (thread_.joinable()) thread_.join();
}

void AdjustmentRun::Solve() {
  const auto begin = std::chrono::steady_clock::now();
  try {
    summary_ = solver_(problem_.bundle, abort_);
  } catch (const std::exception& e) {  // out of memory: the map stays as it is
    spdlog::warn("slam: an adjustment was given up: {}", e.what());
    summary_ = {.usable = false};
  }
  time_s_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  finished_ = true;
}

void AdjustmentRun::Wait() {
  if (thread_.joinable()) thread_.join();
}

MapProblem AdjustmentRun::TakeSolution() {
  for (BundleCamera& camera : problem_.bundle.cameras) camera.T_world_camera = S_new_old_.Moved(camera.T_world_camera);
  for (BundlePoint& point : problem_.bundle.points) point.position_world = S_new_old_ * point.position_world;
  for (SE3<World, Camera>& pose : problem_.before) pose = S_new_old_.Moved(pose);
  return std::move(problem_);
}

void AbortedRuns::Add(std::unique_ptr<AdjustmentRun> run) {
  std::erase_if(runs_, [](const auto& old) { return old->IsFinished(); });
  if (!run) return;
  run->Abort();
  runs_.push_back(std::move(run));
}

}  // namespace romap::slam
