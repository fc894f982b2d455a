#include "server/slam/optimize/pose_graph.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "server/slam/optimize/pose_graph_cost.h"
#include "tests/unit/server/slam/optimize/jacobians.h"

namespace romap::slam::pose_graph_test {

using std::numbers::pi;

// A path once around a circle: the true poses, the poses of drifting odometry, its edges, and an edge that closes the
// loop.
struct Loop {
  std::vector<SE3<World, Camera>> truth;
  std::vector<PoseGraphNode> nodes;
  std::vector<PoseGraphEdge> edges;
};

// `drift`: the error that each step adds: rotation (rad), translation (for a radius of 1), logarithm of the scale
// factor.
Loop MakeLoop(int count, const Sim3Vector& drift, double length_mu = 1) {
  Loop loop;
  for (int i = 0; i < count; ++i) {
    const double angle_rad = 2 * pi * i / count;
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ()));
    loop.truth.emplace_back(rotation, length_mu * (rotation * Eigen::Vector3d::UnitX()));
  }
  Sim3Vector step_error = drift;
  step_error.segment<3>(3) *= length_mu;
  loop.nodes.push_back({Sim3<World, Camera>(loop.truth[0]), true});
  for (int i = 1; i < count; ++i) {
    const Sim3<Camera, Camera> step =
        Sim3<Camera, Camera>(loop.truth[i - 1].Inverse() * loop.truth[i]) * ExpSim3<Camera>(step_error);
    loop.nodes.push_back({loop.nodes.back().S_world_camera * step, false});
    loop.edges.push_back({i - 1, i, step, 1});
  }
  loop.edges.push_back({count - 1, 0, Sim3<Camera, Camera>(loop.truth.back().Inverse() * loop.truth[0]), 1});
  return loop;
}

double RmsErrorMu(const Loop& loop) {
  double sum = 0;
  for (size_t i = 0; i < loop.nodes.size(); ++i) {
    sum += (loop.nodes[i].S_world_camera.translation() - loop.truth[i].translation()).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(loop.nodes.size()));
}

const Sim3Vector kDrift = (Sim3Vector() << 0.001, -0.001, 0.002, 0.0005, 0.001, -0.0005, 0.004).finished();

TEST(RelativePoseCost, JacobiansMatchFiniteDifferences) {
  for (const double size : {0.0, 1e-6, 0.05, 1.0}) {
    NodeState a(Sim3<World, Camera>(1.3, ExpRotation({0.4, -0.9, 1.3}), {0.5, -0.2, 0.8}));
    NodeState b(Sim3<World, Camera>(0.8, ExpRotation({-0.2, 0.4, 0.3}), {-0.5, 0.7, 0.1}));
    for (int i = 0; i < 7; ++i) {
      a.increment[i] = size * 0.1 * (i - 3);
      b.increment[i] = size * 0.15 * (2 - i);
    }
    const RelativePoseCost cost(&a, &b, Sim3<Camera, Camera>(0.9, ExpRotation({-0.5, 1.1, -0.7}), {0.2, 0.1, 0.4}),
                                2.5);
    ExpectJacobiansMatch(cost, {a.increment.data(), b.increment.data()}, [&] {
      a.Refresh();
      b.Refresh();
    });
  }
}

TEST(PoseGraph, LoopDistributesDriftOfPoseAndScale) {
  Loop loop = MakeLoop(100, kDrift);
  const double before_mu = RmsErrorMu(loop);
  ASSERT_GT(before_mu, 0.1);
  const PoseGraphSummary summary = OptimizePoseGraph(loop.nodes, loop.edges, {});
  EXPECT_TRUE(summary.usable);
  EXPECT_GT(summary.iterations, 0);
  EXPECT_LT(summary.final_cost, 0.1 * summary.initial_cost);
  EXPECT_LT(RmsErrorMu(loop), 0.1 * before_mu) << before_mu;
}

TEST(PoseGraph, FixedScaleKeepsScalesAndImprovesPoses) {
  // Only errors that a rigid loop can reveal: longer steps would only make a larger circle.
  const Sim3Vector drift = (Sim3Vector() << 0, 0, 0.002, 0, 0, 0.001, 0).finished();
  Loop loop = MakeLoop(100, drift);
  const double before_mu = RmsErrorMu(loop);
  const PoseGraphSummary summary = OptimizePoseGraph(loop.nodes, loop.edges, {.fix_scale = true});
  EXPECT_TRUE(summary.usable);
  for (const PoseGraphNode& node : loop.nodes) EXPECT_EQ(node.S_world_camera.scale(), 1);
  EXPECT_LT(RmsErrorMu(loop), 0.1 * before_mu) << before_mu;
}

TEST(PoseGraph, FixedNodesDoNotMove) {
  Loop loop = MakeLoop(50, kDrift);
  loop.nodes[20].fixed = true;
  const std::vector<PoseGraphNode> before = loop.nodes;
  ASSERT_TRUE(OptimizePoseGraph(loop.nodes, loop.edges, {}).usable);
  for (const int i : {0, 20}) {
    EXPECT_EQ(loop.nodes[i].S_world_camera.translation(), before[i].S_world_camera.translation());
    EXPECT_EQ(loop.nodes[i].S_world_camera.rotation().coeffs(), before[i].S_world_camera.rotation().coeffs());
    EXPECT_EQ(loop.nodes[i].S_world_camera.scale(), before[i].S_world_camera.scale());
  }
  EXPECT_NE(loop.nodes[10].S_world_camera.translation(), before[10].S_world_camera.translation());
}

TEST(PoseGraph, DoesNotDependOnTheUnitOfTheMap) {
  Loop loop = MakeLoop(60, kDrift);
  ASSERT_TRUE(OptimizePoseGraph(loop.nodes, loop.edges, {}).usable);
  for (const double unit : {0.01, 100.0}) {
    Loop scaled = MakeLoop(60, kDrift, unit);
    ASSERT_TRUE(OptimizePoseGraph(scaled.nodes, scaled.edges, {}).usable);
    for (size_t i = 0; i < loop.nodes.size(); ++i) {
      EXPECT_LT(
          (scaled.nodes[i].S_world_camera.translation() / unit - loop.nodes[i].S_world_camera.translation()).norm(),
          1e-9);
    }
  }
}

TEST(PoseGraph, EdgesWithLargeWeightChangeLess) {
  // Two measurements of one step disagree: the result is their mean, weighted by the weights of the edges.
  std::vector<PoseGraphNode> nodes(2);
  nodes[0].fixed = true;
  const auto step = [](double x_mu) { return Sim3<Camera, Camera>(1, Eigen::Quaterniond::Identity(), {x_mu, 0, 0}); };
  nodes[1].S_world_camera = Sim3<World, Camera>(1, Eigen::Quaterniond::Identity(), {5, 0, 0});
  ASSERT_TRUE(OptimizePoseGraph(nodes, {{0, 1, step(1), 3}, {0, 1, step(2), 1}}, {}).usable);
  EXPECT_NEAR(nodes[1].S_world_camera.translation().x(), 1.25, 1e-6);
}

TEST(PoseGraph, RejectsDisconnectedGraphs) {
  Loop loop = MakeLoop(20, kDrift);
  const std::vector<PoseGraphNode> before = loop.nodes;
  const auto unchanged = [&] {
    for (size_t i = 0; i < before.size(); ++i) {
      if (loop.nodes[i].S_world_camera.translation() != before[i].S_world_camera.translation()) return false;
    }
    return true;
  };
  std::vector<PoseGraphEdge> cut;
  for (const PoseGraphEdge& edge : loop.edges) {
    if (edge.a != 9 && edge.a != 15) cut.push_back(edge);  // nodes 10..15 are disconnected
  }
  EXPECT_FALSE(OptimizePoseGraph(loop.nodes, cut, {}).usable);
  EXPECT_TRUE(unchanged());

  loop.nodes[0].fixed = false;
  EXPECT_FALSE(OptimizePoseGraph(loop.nodes, loop.edges, {}).usable);
  EXPECT_TRUE(unchanged());
  EXPECT_FALSE(OptimizePoseGraph(loop.nodes, {}, {}).usable);
  std::vector<PoseGraphNode> none;
  EXPECT_FALSE(OptimizePoseGraph(none, {}, {}).usable);
}

TEST(PoseGraph, InvalidInputIsIgnoredOrRejected) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Loop clean = MakeLoop(30, kDrift);
  Loop loop = clean;
  loop.edges.push_back({0, 500, {}, 1});
  loop.edges.push_back({-1, 3, {}, 1});
  loop.edges.push_back({4, 4, {}, 1});
  loop.edges.push_back({2, 7, {}, nan});
  loop.edges.push_back({2, 7, {}, -1});
  loop.edges.push_back({2, 7, Sim3<Camera, Camera>(1, Eigen::Quaterniond::Identity(), {nan, 0, 0}), 1});
  loop.edges.push_back({2, 7, Sim3<Camera, Camera>(0, Eigen::Quaterniond::Identity(), {1, 0, 0}), 1});
  ASSERT_TRUE(OptimizePoseGraph(clean.nodes, clean.edges, {}).usable);
  ASSERT_TRUE(OptimizePoseGraph(loop.nodes, loop.edges, {}).usable);
  for (size_t i = 0; i < loop.nodes.size(); ++i) {
    EXPECT_EQ(loop.nodes[i].S_world_camera.translation(), clean.nodes[i].S_world_camera.translation());
  }
  loop.nodes[3].S_world_camera = Sim3<World, Camera>(1, Eigen::Quaterniond::Identity(), {nan, 0, 0});
  EXPECT_FALSE(OptimizePoseGraph(loop.nodes, loop.edges, {}).usable);
}

}  // namespace romap::slam::pose_graph_test
