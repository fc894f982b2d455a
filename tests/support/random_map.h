#pragma once

#include <cstdint>
#include <random>
#include <set>
#include <vector>

#include "common/map_events.h"
#include "server/session/map_state.h"

namespace romap::testing_support {

// Applies random changes of every kind that the stages make to a map: objects are created, changed, confirmed, lost,
// merged (in chains), removed, given meshes and moved by corrections. Some changes refer to objects that were already
// removed.
class RandomMap {
 public:
  RandomMap(uint64_t seed, session::MapState* map) : random_(seed), map_(map) {}

  // Applies one change.
  void Step() {
    const int percent = Pick(0, 99);
    if (percent < 12 || current_.empty()) return Create();
    if (percent < 40) return map_->Apply(Change(AnyObject()));
    if (percent < 60) return map_->PublishMesh(MeshOf(AnyObject()), {PoseAt(Number()), {}});
    if (percent < 68) return Correct();
    if (percent < 78) return Merge();
    if (percent < 86) return Remove();
    if (percent < 92) return ChangeRemovedObject();
    PublishOtherEvents();
  }

  int Pick(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }

 private:
  double Number() { return std::uniform_real_distribution<double>(-5, 5)(random_); }
  uint64_t AnyObject() { return *std::next(current_.begin(), Pick(0, static_cast<int>(current_.size()) - 1)); }

  static SE3<World, Object> PoseAt(double x) { return {Eigen::Quaterniond::Identity(), Eigen::Vector3d(x, 0, 0)}; }

  void Create() {
    current_.insert(++last_id_);
    map_->Apply(Change(last_id_));
  }

  ObjectUpdate Change(uint64_t id) {
    ObjectUpdate update;
    update.id = ObjectId{id};
    update.state = static_cast<ObjectState>(Pick(0, 2));
    update.class_name = Pick(0, 1) == 0 ? "mug" : "book";
    update.cuboid.T_world_object = PoseAt(Number());
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

  // Publishes events that do not concern objects but use the same outbox.
  void PublishOtherEvents() {
    FrameAck ack;
    ack.frame_id = ++frames_;
    map_->Acknowledge(ack, static_cast<int64_t>(frames_));
    map_->Acknowledge(MasksAck{.frame_id = frames_, .accepted = true, .error = ""});
    Statistics statistics;
    statistics.frames_received = frames_;
    map_->Publish(statistics);
  }

  // Like Pipeline::Publish(): moves all objects first, then publishes their updates.
  void Correct() {
    const Sim3<World, World> S_new_old(1 + 0.01 * Number(), Eigen::Quaterniond::Identity(),
                                       Eigen::Vector3d(Number(), 0, 0));
    for (const uint64_t id : current_) map_->MoveObject(ObjectId{id}, S_new_old);
    for (const uint64_t id : current_) map_->Apply(Change(id));
  }

  void Merge() {
    const uint64_t from = AnyObject(), into = AnyObject();
    if (from == into) return;
    End(from);
    map_->Apply(ObjectMerged{.from = ObjectId{from}, .into = ObjectId{into}});
    if (Pick(0, 2) == 0) map_->Apply(Change(into));
  }

  void Remove() {
    const uint64_t id = AnyObject();
    End(id);
    map_->Apply(ObjectRemoved{.id = ObjectId{id}, .revision = 0, .reason = "false landmark"});
  }

  void End(uint64_t id) {
    current_.erase(id);
    removed_.push_back(id);
  }

  // Applies changes that must have no effect.
  void ChangeRemovedObject() {
    if (removed_.empty()) return;
    const uint64_t id = removed_[static_cast<size_t>(Pick(0, static_cast<int>(removed_.size()) - 1))];
    map_->Apply(Change(id));
    map_->PublishMesh(MeshOf(id), {PoseAt(0), {}});
    map_->Apply(ObjectRemoved{.id = ObjectId{id}, .revision = 0, .reason = "again"});
    map_->Apply(ObjectMerged{.from = ObjectId{id}, .into = ObjectId{AnyObject()}});
  }

  std::mt19937_64 random_;
  session::MapState* const map_;
  std::set<uint64_t> current_;
  std::vector<uint64_t> removed_;
  uint64_t last_id_ = 0, frames_ = 0;
};

}  // namespace romap::testing_support
