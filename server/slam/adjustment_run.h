#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "common/geometry.h"
#include "server/slam/map_adjustment.h"

namespace romap::slam {

// The adjustment of a copy of a part of the map, on the calling thread or on a thread of its own. Call all functions
// from one thread.
class AdjustmentRun {
 public:
  // Adjusts the problem; may end early once `abort` is set.
  using Solver = std::function<BundleSummary(BundleProblem& problem, const std::atomic<bool>& abort)>;

  // Starts the adjustment. `run_inline`: it is finished when the constructor returns. Otherwise its thread runs at a
  // lower priority by `nice`.
  AdjustmentRun(MapProblem problem, Solver solver, bool run_inline, int nice);
  ~AdjustmentRun();  // aborts it
  AdjustmentRun(const AdjustmentRun&) = delete;
  AdjustmentRun& operator=(const AdjustmentRun&) = delete;

  bool IsFinished() const { return finished_; }
  void Wait();
  // Does not wait until it ends.
  void Abort() { abort_ = true; }
  // The map was moved by a similarity: TakeSolution() returns the solution in the new world.
  void Move(const Sim3<World, World>& S_new_old) { S_new_old_ = S_new_old * S_new_old_; }
  // Require IsFinished(). The summary is not usable if the process had no memory or thread for the adjustment.
  MapProblem TakeSolution();                                       // at most once
  const BundleProblem& bundle() const { return problem_.bundle; }  // in the world of its start
  const BundleSummary& summary() const { return summary_; }
  double time_s() const { return time_s_; }

 private:
  void Solve();

  MapProblem problem_;
  Sim3<World, World> S_new_old_;
  const Solver solver_;
  BundleSummary summary_;
  double time_s_ = 0;
  std::atomic<bool> abort_ = false;
  std::atomic<bool> finished_ = false;
  std::thread thread_;
};

// Runs that were aborted and not yet ended, so that nobody waits for them.
class AbortedRuns {
 public:
  void Add(std::unique_ptr<AdjustmentRun> run);

 private:
  std::vector<std::unique_ptr<AdjustmentRun>> runs_;
};

}  // namespace romap::slam
