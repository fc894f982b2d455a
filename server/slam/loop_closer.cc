#include "server/slam/loop_closer.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "server/slam/optimize/pose_graph.h"
#include "server/slam/point_maker.h"

namespace romap::slam {
namespace {

// Minimum for an edge of the pose graph in addition to the edges to parents and loops.
constexpr int kStrongSharedPoints = 80;
constexpr double kLoopWeight = 3;  // relative to an edge between neighbors
constexpr size_t kFusedNeighbors = 12;

using Similarities = std::map<KeyframeId, Sim3<World, Camera>>;

Sim3<Camera, Camera> Between(const Similarities& poses, KeyframeId a, KeyframeId b) {
  return poses.at(a).Inverse() * poses.at(b);
}

// Edges between keyframes as they were before the correction, and the measured edge of the new loop.
std::vector<PoseGraphEdge> Edges(const SlamMap& map, const Similarities& before, const LoopMatch& loop,
                                 const std::map<KeyframeId, int>& node_of) {
  std::vector<PoseGraphEdge> edges;
  std::set<std::pair<KeyframeId, KeyframeId>> known;
  const auto add = [&](KeyframeId a, KeyframeId b, const Sim3<Camera, Camera>& S_a_b, double weight) {
    if (a == b || !known.insert(std::minmax(a, b)).second) return;
    edges.push_back({.a = node_of.at(a), .b = node_of.at(b), .S_a_b = S_a_b, .weight = weight});
  };
  add(loop.old, loop.newest, loop.S_old_newest, kLoopWeight);
  for (const auto& [id, keyframe] : map.keyframes()) {
    for (const auto& [other, S_this_other] : keyframe.loops) add(id, other, Between(before, id, other), kLoopWeight);
    if (keyframe.parent) add(keyframe.parent, id, Between(before, keyframe.parent, id), 1);
    for (const auto& [other, shared] : map.Covisible(keyframe, kStrongSharedPoints)) {
      add(id, other, Between(before, id, other), 1);
    }
  }
  return edges;
}

// Moves all keyframes; each point moves with the keyframe that observed it first.
void MoveMap(const Similarities& before, const Similarities& after, SlamMap& map) {
  std::map<KeyframeId, Sim3<World, World>> moved;
  for (auto& [id, keyframe] : map.keyframes()) {
    const Sim3<World, World> S_new_old = after.at(id) * before.at(id).Inverse();
    moved.emplace(id, S_new_old);
    keyframe.SetPose(after.at(id).Rigid());
    keyframe.scale *= S_new_old.scale();
  }
  for (auto& [id, track] : map.points()) {
    const Sim3<World, World>& S_new_old = moved.at(track.observations.front().keyframe);
    track.point.position_world = S_new_old * track.point.position_world;
    map.Refresh(track);
  }
}

// Moves the keyframes of `new_side` onto the old side and distributes the error. False: the optimization failed and the
// map is unchanged.
bool CorrectDrift(const LoopMatch& loop, bool fix_scale, const std::vector<MapKeyframe*>& new_side, SlamMap& map) {
  Similarities before;
  std::map<KeyframeId, int> node_of;
  std::vector<PoseGraphNode> nodes;
  for (const auto& [id, keyframe] : map.keyframes()) {
    before.emplace(id, Sim3<World, Camera>(keyframe.T_world_camera()));
    node_of[id] = static_cast<int>(nodes.size());
    // Given poses are exact, and the old side defines the world.
    nodes.push_back({.S_world_camera = before.at(id), .fixed = keyframe.pose_given || id == loop.old});
  }
  const std::vector<PoseGraphEdge> edges = Edges(map, before, loop, node_of);
  // Start the optimization with the new side at its pose according to the loop.
  const Sim3<World, Camera> S_world_newest = before.at(loop.old) * loop.S_old_newest;
  const Sim3<World, World> S_new_old = S_world_newest * before.at(loop.newest).Inverse();
  for (const MapKeyframe* keyframe : new_side) {
    PoseGraphNode& node = nodes[static_cast<size_t>(node_of.at(keyframe->id))];
    if (!node.fixed) node.S_world_camera = S_new_old * before.at(keyframe->id);
  }
  const PoseGraphSummary summary = OptimizePoseGraph(nodes, edges, {.fix_scale = fix_scale});
  spdlog::debug(
      "slam: loop from {} to {}: drift {:.0f} px, scale {:.3f}; pose graph of {} keyframes and {} edges, cost {:.3g} "
      "-> {:.3g}",
      loop.newest.ToString(), loop.old.ToString(), loop.drift_px, S_new_old.scale(), nodes.size(), edges.size(),
      summary.initial_cost, summary.final_cost);
  if (!summary.usable) return false;
  Similarities after;
  for (const auto& [id, node] : node_of) after.emplace(id, nodes[static_cast<size_t>(node)].S_world_camera);
  MoveMap(before, after, map);
  return true;
}

// The keyframe and its neighbors.
std::vector<MapKeyframe*> WithNeighbors(MapKeyframe& keyframe, SlamMap& map) {
  std::vector<MapKeyframe*> side = {&keyframe};
  for (const auto& [id, shared] : map.Covisible(keyframe, kMinSharedPoints)) side.push_back(map.FindKeyframe(id));
  return side;
}

}  // namespace

bool CloseLoop(const LoopMatch& loop, bool fix_scale, const SlamConfig& config, SlamMap& map) {
  MapKeyframe& newest = *map.FindKeyframe(loop.newest);
  MapKeyframe& old = *map.FindKeyframe(loop.old);
  const bool drifted = loop.drift_px > kNoDrift_px;
  if (drifted) {
    if (!CorrectDrift(loop, fix_scale, WithNeighbors(newest, map), map)) return false;
    newest.loops.emplace_back(loop.old, loop.S_old_newest.Inverse());
    old.loops.emplace_back(loop.newest, loop.S_old_newest);
  } else {
    spdlog::debug("slam: loop from {} to {} without correction: drift {:.1f} px", loop.newest.ToString(),
                  loop.old.ToString(), loop.drift_px);
  }
  FuseSides(loop, config, map);
  return drifted;
}

void FuseSides(const LoopMatch& loop, const SlamConfig& config, SlamMap& map) {
  std::vector<MapKeyframe*> new_side = WithNeighbors(*map.FindKeyframe(loop.newest), map);
  std::vector<MapKeyframe*> old_side = WithNeighbors(*map.FindKeyframe(loop.old), map);
  for (const auto& [from, into] : loop.same_points) map.MergePoints(from, into);
  PointMaker maker(config, &map);
  if (old_side.size() > kFusedNeighbors) old_side.resize(kFusedNeighbors);
  if (new_side.size() > kFusedNeighbors) new_side.resize(kFusedNeighbors);
  for (MapKeyframe* keyframe : new_side) maker.FuseDuplicates(*keyframe, old_side);
}

}  // namespace romap::slam
