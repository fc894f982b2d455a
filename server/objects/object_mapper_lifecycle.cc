// The part of ObjectMapper that decides what is told to the world: confirmation, merging, updates and views.

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "common/map_motion.h"
#include "server/objects/angles.h"
#include "server/objects/object_mapper.h"
#include "server/objects/two_sample_test.h"

namespace romap::objects {
namespace {

// Share of `points` inside the cuboid, its half extents enlarged a little.
double ShareInside(const Cuboid& cuboid, const std::vector<Eigen::Vector3d>& points_world) {
  if (points_world.empty()) return 0;
  const SE3<Object, World> T_object_world = cuboid.T_world_object.Inverse();
  const Eigen::Vector3d half_extents = 1.05 * cuboid.half_extents;
  const auto inside = std::count_if(points_world.begin(), points_world.end(), [&](const Eigen::Vector3d& p) {
    return ((T_object_world * p).cwiseAbs().array() <= half_extents.array()).all();
  });
  return static_cast<double>(inside) / static_cast<double>(points_world.size());
}

// Largest move of a face in terms of the size, and whether the yaw turned notably.
bool DiffersNotably(const Cuboid& a, const Cuboid& b) {
  const double size = 2 * a.half_extents.maxCoeff();
  const double shift = (a.T_world_object.translation() - b.T_world_object.translation()).norm();
  const double growth = 2 * (a.half_extents - b.half_extents).cwiseAbs().maxCoeff();
  const double turn_rad = a.T_world_object.rotation().angularDistance(b.T_world_object.rotation());
  constexpr double kChangeShare = 0.02;
  constexpr double kTurnRad = 2 * kRadPerDeg;
  return std::max(shift, growth) > kChangeShare * size || turn_rad > kTurnRad;
}

// Whether what was told of a cuboid is noticeably wrong since the map was corrected. `S_now_told` also turns meshes in
// ways that do not show in an upright cuboid.
bool MovedNoticeably(const Cuboid& told, const Cuboid& now, const Sim3<World, World>& S_now_told) {
  constexpr double kShiftShare = 0.005;
  constexpr double kScaleShare = 0.002;
  constexpr double kTurnRad = 0.2 * kRadPerDeg;
  const double size = 2 * told.half_extents.maxCoeff();
  const double shift = (now.T_world_object.translation() - told.T_world_object.translation()).norm();
  const double turn_rad = std::max(now.T_world_object.rotation().angularDistance(told.T_world_object.rotation()),
                                   S_now_told.rotation().angularDistance(Eigen::Quaterniond::Identity()));
  return shift > kShiftShare * size || turn_rad > kTurnRad || std::abs(std::log(S_now_told.scale())) > kScaleShare;
}

// In counts of landmark `owner`: `from` is called `into` from now on.
void RenameKey(LandmarkKey from, LandmarkKey into, LandmarkKey owner, std::map<LandmarkKey, uint64_t>* counts) {
  const auto old = counts->find(from);
  if (old == counts->end()) return;
  if (owner != into) (*counts)[into] += old->second;
  counts->erase(old);
}

}  // namespace

// Whether a landmark is there whenever it ought to be, in the shape that is known of it.
bool ObjectMapper::IsSteady(const Landmark& landmark) const {
  const auto sightings = static_cast<double>(landmark.sightings);
  if (sightings < config_.confirm_seen_share * static_cast<double>(landmark.expected)) return false;
  constexpr uint64_t kEnoughToJudge = 3;
  constexpr double kMinAgreement = 0.5;  // mean agreement of the masks with the shape
  const bool agrees = landmark.agreement_count < kEnoughToJudge ||
                      landmark.agreement_sum >= kMinAgreement * static_cast<double>(landmark.agreement_count);
  // A piece of another thing is mostly a part of that one's mask.
  const bool stands_alone = std::all_of(landmark.covered_by.begin(), landmark.covered_by.end(),
                                        [&](const auto& cover) { return cover.second <= landmark.sightings; });
  return agrees && stands_alone;
}

// Evidence that a landmark is a thing: seen often, from different sides, and with a box of believable form.
bool ObjectMapper::IsProven(const Landmark& landmark) const {
  if (!landmark.cuboid) return false;
  constexpr double kMostElongated = 60;
  const Eigen::Vector3d& half = landmark.cuboid->half_extents;
  const bool believable = half.minCoeff() > 0 && half.maxCoeff() < kMostElongated * half.minCoeff();
  // Without points the masks alone must say where it is, which takes a wider base.
  const bool has_points = landmark.points.size() >= static_cast<size_t>(config_.min_object_points);
  const double parallax_rad = (has_points ? 1.0 : 1.5) * config_.confirm_parallax_deg * kRadPerDeg;
  return believable && IsSteady(landmark) && landmark.sightings >= static_cast<uint64_t>(config_.confirm_frames) &&
         landmark.keyframe_sightings >= config_.confirm_keyframes && landmark.parallax_rad >= parallax_rad;
}

void ObjectMapper::ConfirmProven(const std::vector<LandmarkKey>& keys) {
  for (LandmarkKey key : keys) {
    Landmark& landmark = *FindLandmark(key);
    if (landmark.state != ObjectState::kProvisional || !IsProven(landmark)) continue;
    // A duplicate is merged before it is ever announced.
    const bool duplicate = std::any_of(landmarks_.begin(), landmarks_.end(), [&](const auto& other) {
      return other->key != key && other->state != ObjectState::kProvisional && AreTheSame(landmark, *other);
    });
    if (duplicate) continue;
    landmark.state = ObjectState::kConfirmed;
    if (!landmark.id) landmark.id = ObjectId{++last_id_};
    spdlog::debug("objects: landmark {} is {} ({}): {} sightings, {} points, parallax {:.0f} deg", key,
                  landmark.id.ToString(), landmark.BestClass().first, landmark.sightings, landmark.points.size(),
                  landmark.parallax_rad / kRadPerDeg);
  }
}

// A provisional landmark is announced when there is something to show.
bool ObjectMapper::IsAnnounceable(const Landmark& landmark) const {
  constexpr uint64_t kFewestSightings = 3;
  return landmark.cuboid && landmark.cuboid->half_extents.minCoeff() > 0 && landmark.sightings >= kFewestSightings;
}

// How many frames speak for two things, and how many for one thing twice.
ObjectMapper::Company ObjectMapper::CompanyOf(const Landmark& a, const Landmark& b) {
  const auto count = [](const std::map<LandmarkKey, uint64_t>& counts, LandmarkKey key) {
    const auto found = counts.find(key);
    return found == counts.end() ? uint64_t{0} : found->second;
  };
  return {.together = count(a.seen_beside, b.key), .covered = count(a.covered_by, b.key) + count(b.covered_by, a.key)};
}

// Two landmarks are one thing when they take the same place and were never seen side by side. A detector that cuts
// things in pieces shows one thing as two at times; then mostly one mask covers both.
bool ObjectMapper::AreTheSame(const Landmark& a, const Landmark& b) const {
  if (!a.cuboid && !b.cuboid) return false;
  const auto [together, covered] = CompanyOf(a, b);
  if (together > 0 && covered <= 2 * together) return false;
  const bool same_class = a.BestClass().first == b.BestClass().first;
  if (!a.cuboid || !b.cuboid) {
    const Landmark& with_box = a.cuboid ? a : b;
    const Landmark& without = a.cuboid ? b : a;
    return same_class && together == 0 && ShareInside(*with_box.cuboid, without.body_world) > 0.7 &&
           PointsAgree(with_box, without).value_or(false);
  }
  const double reach = a.cuboid->half_extents.norm() + b.cuboid->half_extents.norm();
  if ((a.cuboid->T_world_object.translation() - b.cuboid->T_world_object.translation()).norm() > reach) return false;
  const double overlap = std::max(ShareInside(*a.cuboid, b.body_world), ShareInside(*b.cuboid, a.body_world));
  constexpr double kSurely = 0.7;
  constexpr double kProbably = 0.5;
  constexpr double kPossibly = 0.25;
  if (overlap > kSurely) return true;
  if (!same_class || together > 0) return false;
  // Two looks from far apart at a thing that is known from one side only may disagree on where it ends.
  return overlap > kProbably || (overlap > kPossibly && PointsAgree(a, b).value_or(true));
}

// Whether the map points on both may be those of one thing that was looked at from two sides (SamePlace); nullopt when
// there are too few to tell.
std::optional<bool> ObjectMapper::PointsAgree(const Landmark& a, const Landmark& b) const {
  constexpr double kAlpha = 0.05;
  constexpr double kShiftShare = 0.25;  // of the size, between the means of two looks
  constexpr double kPointSigmaShare = 0.02;
  const std::vector<Eigen::Vector3d> points_a = PointsOf(a);
  const std::vector<Eigen::Vector3d> points_b = PointsOf(b);
  const double size_mu = 2 * (a.cuboid ? a : b).cuboid->half_extents.maxCoeff();
  const auto same =
      SamePlace(points_a, points_b, kAlpha, kShiftShare * size_mu, std::max(kPointSigmaShare * size_mu, 1e-9));
  spdlog::debug("objects: landmarks {} and {}: {} and {} points {}", a.key, b.key, points_a.size(), points_b.size(),
                !same   ? "are too few to compare"
                : *same ? "may be of one thing"
                        : "lie apart");
  return same;
}

std::vector<Eigen::Vector3d> ObjectMapper::PointsOf(const Landmark& landmark) const {
  std::vector<Eigen::Vector3d> points_world;
  for (const MapPointId& id : landmark.points) {
    if (const Eigen::Vector3d* p_world = registry_.Find(id)) points_world.push_back(*p_world);
  }
  return landmark.cuboid ? points_world : landmark.body_world;
}

void ObjectMapper::MergeDuplicates(ObjectOutput* output) {
  for (size_t i = 0; i < landmarks_.size(); ++i) {
    for (size_t j = i + 1; j < landmarks_.size();) {
      if (!AreTheSame(*landmarks_[i], *landmarks_[j])) {
        ++j;
        continue;
      }
      // The one that clients know longer stays.
      const auto rank = [](const Landmark& landmark) {
        return std::tuple(landmark.state == ObjectState::kProvisional, !landmark.id, landmark.id);
      };
      const bool swap = rank(*landmarks_[j]) < rank(*landmarks_[i]);
      if (swap) std::swap(landmarks_[i], landmarks_[j]);
      Merge(*landmarks_[j], *landmarks_[i], output);
      landmarks_.erase(landmarks_.begin() + static_cast<std::ptrdiff_t>(j));
    }
  }
}

void ObjectMapper::Merge(Landmark& from, Landmark& into, ObjectOutput* output) {
  spdlog::debug("objects: landmark {} merges into landmark {}", from.key, into.key);
  registry_.Merge(from.key, into.key);
  // Pieces of a thing do not show its outline.
  const bool is_piece = CompanyOf(from, into).together > 0;
  if (!is_piece) {
    for (const Silhouette& silhouette : from.shape.silhouettes())
      into.needs_fit |= into.shape.AddSilhouette(silhouette);
  }
  for (const auto& [name, evidence] : from.class_evidence) into.class_evidence[name] += evidence;
  for (const auto& [key, count] : from.seen_beside) into.seen_beside[key] += count;
  for (const auto& [key, count] : from.covered_by) into.covered_by[key] += count;
  into.seen_beside.erase(into.key);
  into.covered_by.erase(into.key);
  into.sightings += from.sightings;
  into.expected += from.sightings;
  into.keyframe_sightings += from.keyframe_sightings;
  into.keyframes.insert(into.keyframes.end(), from.keyframes.begin(), from.keyframes.end());
  if (from.last_frame > into.last_frame) {
    into.last_frame = from.last_frame;
    into.last_box_px = from.last_box_px;
    into.last_T_world_camera = from.last_T_world_camera;
    into.last_track_id = from.last_track_id;
    into.missed_in_view = from.missed_in_view;
  }
  for (const auto& landmark : landmarks_) {
    landmark->views.RenameNeighbour(from.key, into.key);
    if (landmark.get() == &from) continue;
    RenameKey(from.key, into.key, landmark->key, &landmark->seen_beside);
    RenameKey(from.key, into.key, landmark->key, &landmark->covered_by);
  }
  std::replace(current_.keys.begin(), current_.keys.end(), from.key, into.key);
  std::vector<ObjectView> adopted;
  if (!is_piece) adopted = into.views.Adopt(std::move(from.views), into.id, into.cuboid->T_world_object.translation());
  if (!from.published) return;
  if (!into.published) Publish(into, /*force=*/true, output);  // clients must know whom they are told of
  output->events.emplace_back(ObjectMerged{.from = from.id, .into = into.id});
  Publish(into, /*force=*/true, output);
  if (!adopted.empty()) {
    output->views.push_back({.object = into.id, .cuboid = *into.reach, .new_views = adopted});
  }
}

void ObjectMapper::PublishAll(const std::vector<LandmarkKey>& keys, ObjectOutput* output) {
  for (LandmarkKey key : keys) {
    Landmark* landmark = FindLandmark(key);  // may have been merged away
    if (landmark == nullptr) continue;
    if (!landmark->id && IsAnnounceable(*landmark)) landmark->id = ObjectId{++last_id_};
    if (landmark->id) Publish(*landmark, /*force=*/false, output);
  }
}

// The cuboid that was told, as it stands after the corrections since.
Cuboid ObjectMapper::ToldCuboid(const Landmark& landmark) const {
  const Sim3<World, World> S_now_told = landmark.S_now_told.value_or(Sim3<World, World>());
  return Upright(Moved(S_now_told, landmark.published->cuboid), up_world_);
}

void ObjectMapper::Publish(Landmark& landmark, bool force, ObjectOutput* output) {
  if (!landmark.cuboid) return;
  const auto [class_name, class_score] = landmark.BestClass();
  const bool first = !landmark.published;
  if (first) landmark.S_now_told.reset();
  const Cuboid told = first ? *landmark.cuboid : ToldCuboid(landmark);
  const bool cuboid_changed = first || DiffersNotably(told, *landmark.cuboid);
  const Cuboid& cuboid = cuboid_changed ? *landmark.cuboid : told;
  const bool text_changed =
      first || landmark.published->class_name != class_name || landmark.published->state != landmark.state;
  const bool moved =
      !first && MovedNoticeably(landmark.published->cuboid, told, landmark.S_now_told.value_or(Sim3<World, World>()));
  ObjectViews views{.object = landmark.id, .cuboid = *landmark.reach};
  if (landmark.state != ObjectState::kProvisional) {
    views.new_views = TakeViews(landmark, *landmark.reach);
    views.corrected_views = landmark.views.TakeCorrectedPoses(*landmark.reach);
  }
  const bool views_changed = !views.new_views.empty() || !views.corrected_views.empty();
  const bool tell = force || cuboid_changed || text_changed || moved;
  if (!tell && !views_changed) return;
  // Whatever is told is told in the corrected world, so the receivers must get there first.
  views.S_new_old = std::exchange(landmark.S_now_told, std::nullopt);
  if (!landmark.has_field) views.S_new_old.reset();  // it begins in the corrected world
  if (tell || views.S_new_old) {
    landmark.published = ObjectUpdate{.id = landmark.id,
                                      .state = landmark.state,
                                      .class_name = class_name,
                                      .class_score = class_score,
                                      .cuboid = cuboid,
                                      .observations = landmark.sightings,
                                      .T_world_mesh = {}};
    output->events.emplace_back(*landmark.published);
  }
  if (landmark.state == ObjectState::kProvisional) return;  // nothing is trained before it is sure
  if (!landmark.has_field || cuboid_changed || moved || views_changed || views.S_new_old) {
    landmark.has_field = true;
    output->views.push_back(std::move(views));
  }
}

std::vector<ObjectView> ObjectMapper::TakeViews(Landmark& landmark, const Cuboid& cuboid) {
  std::vector<ViewContext::Neighbour> neighbours;
  for (const auto& other : landmarks_) {
    if (other->IsConfirmed() && other->key != landmark.key)
      neighbours.push_back({other->key, other->published->cuboid});
  }
  return landmark.views.Take({.object = landmark.id,
                              .cuboid = cuboid,
                              .body_world = landmark.body_world,
                              .object_points = landmark.points,
                              .registry = &registry_,
                              .neighbours = neighbours});
}

ObjectOutput ObjectMapper::Reset() {
  ObjectOutput output;
  for (const auto& landmark : landmarks_) {
    if (!landmark->published) continue;
    output.events.emplace_back(ObjectRemoved{.id = landmark->id, .reason = "map was reset"});
  }
  landmarks_.clear();
  registry_ = {};
  history_.Clear();
  current_ = {};
  scene_depth_mu_ = 0;
  return output;
}

}  // namespace romap::objects
