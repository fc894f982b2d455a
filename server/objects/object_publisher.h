#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <tuple>
#include <vector>

#include "common/stage_messages.h"
#include "server/objects/correction.h"
#include "server/objects/frame_detections.h"
#include "server/objects/landmark_store.h"
#include "server/objects/object_output.h"
#include "server/objects/objects_config.h"
#include "server/objects/view_picker.h"

namespace romap::objects {

// Owns the published state of the landmarks: ids, the last update of each object, the training views that were sent,
// and the corrections that are not published yet.
// Small changes are not published immediately; they accumulate until their sum is noticeable.
class ObjectPublisher {
 public:
  enum class When {
    kChanged,  // only after a noticeable change
    kAlways,
  };

  explicit ObjectPublisher(const ObjectsConfig& config) : config_(config) {}

  // Returns the id of the landmark's object; assigns a new one if it has none yet. Ids are never reused.
  ObjectId AssignId(LandmarkKey key);
  bool HasId(LandmarkKey key) const;
  bool IsPublished(LandmarkKey key) const;
  bool HasUnpublishedCorrection(LandmarkKey key) const;
  // Rank of a landmark in a merge. The landmark of lower rank is kept: confirmed before provisional, then the older id.
  std::tuple<bool, bool, ObjectId> MergeRank(const Landmark& landmark) const;
  // Published cuboids of confirmed and lost objects.
  std::map<LandmarkKey, Cuboid> ConfirmedCuboids(const LandmarkStore& store) const;

  // Offers the unambiguous detections of a keyframe as training views of their landmarks.
  void OfferViews(const KeyframeView& view, const FrameDetections& frame);
  // Applies a map correction: `S_new_old` is the motion of the landmark's space; the keyframes have new poses.
  void Correct(LandmarkKey key, const Sim3<World, World>& S_new_old, const KeyframeCorrections& keyframes);

  // Publishes an update for clients and, for confirmed objects, the cuboid and new views for the field. Publishes
  // nothing for a landmark without a cuboid.
  void Publish(const Landmark& landmark, When when, const LandmarkStore& store, ObjectOutput* output);
  // Publishes the merge of `from` into `into`, which inherits the views if `adopt_views`. Both must still be in the
  // store.
  void Merge(const Landmark& from, const Landmark& into, bool adopt_views, const LandmarkStore& store,
             ObjectOutput* output);
  // Publishes the removal of a landmark if its object was published.
  void Remove(LandmarkKey key, const char* reason, ObjectOutput* output);

 private:
  // Published state of one landmark.
  struct Publication {
    explicit Publication(const ObjectsConfig& config) : views(config) {}

    ObjectId id;  // 0: none yet
    std::optional<ObjectUpdate> last;
    bool has_field = false;  // ObjectViews were sent
    // Motion of the object's space by corrections since `last` and the views were sent; nullopt: no motion.
    std::optional<Sim3<World, World>> S_now_published;
    ViewPicker views;
  };
  struct Change;

  Publication& PublicationOf(LandmarkKey key);
  const Publication* Find(LandmarkKey key) const;
  bool IsConfirmed(const Landmark& landmark) const;
  static Change ChangeOf(const Landmark& landmark, const Eigen::Vector3d& up_world, const Publication& publication);
  std::vector<ObjectView> PickViews(const Landmark& landmark, const LandmarkStore& store, Publication* publication);

  ObjectsConfig config_;
  std::map<LandmarkKey, Publication> publications_;
  uint64_t last_id_ = 0;
};

}  // namespace romap::objects
