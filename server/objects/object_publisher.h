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

// Owns everything that clients and fields know of the landmarks: ids, the last update of each object, the training
// views that were sent, and the corrections that are not published yet.
//
// Changes too small to matter are held back and add up until they are published together.
class ObjectPublisher {
 public:
  enum class When {
    kChanged,  // only if something changed noticeably
    kAlways,
  };

  explicit ObjectPublisher(const ObjectsConfig& config) : config_(config) {}

  // The id of the landmark's object; a new one if it has none yet. Ids are never reused.
  ObjectId AssignId(LandmarkKey key);
  bool HasId(LandmarkKey key) const;
  bool IsPublished(LandmarkKey key) const;
  bool HasUnpublishedCorrection(LandmarkKey key) const;
  // Of two landmarks that merge, the one of lower rank stays: confirmed before provisional, then the older id.
  std::tuple<bool, bool, ObjectId> MergeRank(const Landmark& landmark) const;
  // Published cuboids of confirmed and lost objects.
  std::map<LandmarkKey, Cuboid> ConfirmedCuboids(const LandmarkStore& store) const;

  // Offers the unambiguous detections of a keyframe as training views of their landmarks.
  void OfferViews(const KeyframeView& view, const FrameDetections& frame);
  // The map was corrected: `S_new_old` happened to the landmark's space, and keyframes have new poses.
  void Correct(LandmarkKey key, const Sim3<World, World>& S_new_old, const KeyframeCorrections& keyframes);

  // An update for clients and, for confirmed objects, cuboid and new views for the field. Nothing for a landmark
  // without a cuboid.
  void Publish(const Landmark& landmark, When when, const LandmarkStore& store, ObjectOutput* output);
  // `from` is part of `into`, which inherits its views if `adopt_views`. Both are still in the store.
  void Merge(const Landmark& from, const Landmark& into, bool adopt_views, const LandmarkStore& store,
             ObjectOutput* output);
  // The landmark was removed. Clients are informed if the object was published.
  void Remove(LandmarkKey key, const char* reason, ObjectOutput* output);

 private:
  // What is known outside of one landmark.
  struct Publication {
    explicit Publication(const ObjectsConfig& config) : views(config) {}

    ObjectId id;  // 0: none yet
    std::optional<ObjectUpdate> last;
    bool has_field = false;  // ObjectViews were sent
    // What corrections did to the object's space since `last` and the views were sent; nullopt: nothing.
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
