#include "server/slam/adjustment_run.h"

#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <new>
#include <thread>

#include "tests/unit/server/slam/noisy_map.h"

namespace romap::slam::adjustment_run_test {

using AdjustmentRunTest = NoisyMap;

TEST_F(AdjustmentRunTest, RunsOnTheRequestedThread) {
  for (const bool run_inline : {true, false}) {
    std::thread::id solver_thread;
    AdjustmentRun run(
        GlobalProblem(map_, SlamConfig{}, /*find_lens=*/false),
        [&](BundleProblem&, const std::atomic<bool>&) {
          solver_thread = std::this_thread::get_id();
          return BundleSummary{};
        },
        run_inline, /*nice=*/1);
    run.Wait();
    EXPECT_TRUE(run.IsFinished());
    EXPECT_EQ(solver_thread == std::this_thread::get_id(), run_inline);
  }
}

TEST_F(AdjustmentRunTest, AnExceptionMakesTheSolutionUnusable) {
  for (const bool run_inline : {true, false}) {
    AdjustmentRun run(
        GlobalProblem(map_, SlamConfig{}, /*find_lens=*/false),
        [](BundleProblem&, const std::atomic<bool>&) -> BundleSummary { throw std::bad_alloc(); }, run_inline,
        /*nice=*/1);
    run.Wait();
    EXPECT_TRUE(run.IsFinished());
    EXPECT_FALSE(run.summary().usable);
  }
}

TEST_F(AdjustmentRunTest, SolutionIsInTheMovedWorld) {
  AdjustmentRun run(
      GlobalProblem(map_, SlamConfig{}, /*find_lens=*/false),
      [](BundleProblem&, const std::atomic<bool>&) { return BundleSummary{}; }, /*run_inline=*/true, /*nice=*/0);
  const Sim3<World, World> first(2, Eigen::Quaterniond::Identity(), {1, 0, 0});
  const Sim3<World, World> second(1, Eigen::Quaterniond(Eigen::AngleAxisd(1, Eigen::Vector3d::UnitZ())), {0, 3, 0});
  run.Move(first);
  run.Move(second);
  const MapProblem solution = run.TakeSolution();
  ASSERT_EQ(solution.points.size(), map_.points().size());
  for (size_t i = 0; i < solution.points.size(); ++i) {
    const Eigen::Vector3d& before_world = map_.FindPoint(solution.points[i])->point.position_world;
    EXPECT_LT((solution.bundle.points[i].position_world - second * (first * before_world)).norm(), 1e-9);
  }
  for (size_t i = 0; i < solution.keyframes.size(); ++i) {
    const Eigen::Vector3d& before_world = map_.FindKeyframe(solution.keyframes[i])->center_world();
    const SE3<World, Camera>& after = solution.bundle.cameras[i].T_world_camera;
    EXPECT_LT((after.translation() - second * (first * before_world)).norm(), 1e-9);
    EXPECT_TRUE(after.Matrix().isApprox(solution.before[i].Matrix(), 1e-9));
  }
}

TEST_F(AdjustmentRunTest, AbortedRunsEndLater) {
  std::promise<void> started;
  std::atomic<bool> saw_abort = false;
  {
    AbortedRuns aborted;
    auto run = std::make_unique<AdjustmentRun>(
        GlobalProblem(map_, SlamConfig{}, /*find_lens=*/false),
        [&](BundleProblem&, const std::atomic<bool>& abort) {
          started.set_value();
          while (!abort) std::this_thread::yield();
          saw_abort = true;
          return BundleSummary{};
        },
        /*run_inline=*/false, /*nice=*/0);
    started.get_future().wait();
    aborted.Add(std::move(run));  // returns although the run has not ended
  }
  EXPECT_TRUE(saw_abort);
}

}  // namespace romap::slam::adjustment_run_test
