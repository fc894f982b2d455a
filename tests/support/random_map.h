#pragma once

#include <cstdint>
#include <random>
#include <set>
#include <vector>

#include "common/map_events.h"
#include "server/session/map_state.h"

namespace romap::testing {

// Does to a map, at random, all that stages do to one: objects appear, change, are confirmed, lost, merged (in chains),
// removed, get meshes and are moved by corrections. Now and then something comes late, of an object that is gone.
class RandomMap {
 public:
  RandomMap(uint64_t seed, session::MapState* map) : random_(seed), map_(map) {}

  // One thing happens.
  void Step() {
    const int what = Pick(0, 99);
    if (what < 12 || live_.empty()) return Appear();
    if (what < 40) return map_->Apply(Change(AnyLive()));
    if (what < 60) return map_->PublishMesh(MeshOf(AnyLive()), {PlaceAt(Number()), {}});
    if (what < 68) return Correct();
    if (what < 78) return Merge();
    if (what < 86) return Remove();
    if (what < 92) return ComeLate();
    Answer();
  }

  int Pick(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }

 private:
  double Number() { return std::uniform_real_distribution<double>(-5, 5)(random_); }
  uint64_t AnyLive() { return *std::next(live_.begin(), Pick(0, static_cast<int>(live_.size()) - 1)); }

  static SE3<World, Object> PlaceAt(double x) { return {Eigen::Quaterniond::Identity(), Eigen::Vector3d(x, 0, 0)}; }

  void Appear() {
    live_.insert(++last_id_);
    map_->Apply(Change(last_id_));
  }

  ObjectUpdate Change(uint64_t id) {
    ObjectUpdate update;
    update.id = ObjectId{id};
    update.state = static_cast<ObjectState>(Pick(0, 2));
    update.class_name = Pick(0, 1) == 0 ? "mug" : "book";
    update.cuboid.T_world_object = PlaceAt(Number());
    update.cuboid.half_extents = Eigen::Vector3d(0.1, 0.2, 0.3);
    update.observations = static_cast<uint64_t>(Pick(1, 1000));
    return update;
  }

  MeshUpdate MeshOf(uint64_t id) {
    MeshUpdate mesh;
    mesh.id = ObjectId{id};
    mesh.steps = static_cast<uint64_t>(Pick(1, 1000));
    mesh.draco = "mesh";
    return mesh;
  }

  // What is not about objects, but waits with them.
  void Answer() {
    FrameAck ack;
    ack.frame_id = ++frames_;
    map_->Acknowledge(ack, static_cast<int64_t>(frames_));
    map_->Acknowledge(MasksAck{.frame_id = frames_, .accepted = true, .error = ""});
    Statistics statistics;
    statistics.frames_received = frames_;
    map_->Publish(statistics);
  }

  // As a session does it: all objects move, then clients are told.
  void Correct() {
    const Sim3<World, World> S_new_old(1 + 0.01 * Number(), Eigen::Quaterniond::Identity(),
                                       Eigen::Vector3d(Number(), 0, 0));
    for (const uint64_t id : live_) map_->MoveObject(ObjectId{id}, S_new_old);
    for (const uint64_t id : live_) map_->Apply(Change(id));
  }

  void Merge() {
    const uint64_t from = AnyLive(), into = AnyLive();
    if (from == into) return;
    End(from);
    map_->Apply(ObjectMerged{.from = ObjectId{from}, .into = ObjectId{into}});
    if (Pick(0, 2) == 0) map_->Apply(Change(into));
  }

  void Remove() {
    const uint64_t id = AnyLive();
    End(id);
    map_->Apply(ObjectRemoved{.id = ObjectId{id}, .revision = 0, .reason = "ghost"});
  }

  void End(uint64_t id) {
    live_.erase(id);
    gone_.push_back(id);
  }

  // None of it may show.
  void ComeLate() {
    if (gone_.empty()) return;
    const uint64_t gone = gone_[static_cast<size_t>(Pick(0, static_cast<int>(gone_.size()) - 1))];
    map_->Apply(Change(gone));
    map_->PublishMesh(MeshOf(gone), {PlaceAt(0), {}});
    map_->Apply(ObjectRemoved{.id = ObjectId{gone}, .revision = 0, .reason = "once more"});
    map_->Apply(ObjectMerged{.from = ObjectId{gone}, .into = ObjectId{AnyLive()}});
  }

  std::mt19937_64 random_;
  session::MapState* const map_;
  std::set<uint64_t> live_;
  std::vector<uint64_t> gone_;
  uint64_t last_id_ = 0, frames_ = 0;
};

}  // namespace romap::testing
