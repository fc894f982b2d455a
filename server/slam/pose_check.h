#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "common/diagnostic.h"
#include "common/stage_messages.h"
#include "server/slam/body_rotation.h"
#include "server/slam/frame_features.h"
#include "server/slam/geometry/epipolar.h"
#include "server/slam/geometry/two_view.h"
#include "server/slam/pose_hypothesis.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// Checks given poses against the images. Features are matched between pairs of frames whose images clearly moved. The
// given motion of a pair should explain most of the matches, up to a share of their movement. This share is far above
// the noise of real poses (also a clock that is 20 ms off) and far below the errors of a wrong convention.
//
// A pair contradicts the poses only if another motion of the camera explains its matches much better; scenes that move,
// and textures that repeat, give matches that no motion explains. If the given motion explains the rest of the matches,
// the other motion is that of an object, and the pair does not contradict. The poses are contradicted when most of
// several pairs contradict, or when one of the usual mistakes (PoseHypothesis) explains all pairs, and the given poses
// do not.
class PoseCheck {
 public:
  // Two frames, their matches and what explains them.
  struct Pair {
    uint64_t first_frame_id = 0;
    bool agrees = false;
    bool fits_better = false;  // another motion of the camera fits clearly better
    bool contradicts = false;  // and the given poses do not fit at all
    int matches = 0;
    double given_share = 0;           // of the matches: explained by the given poses, with more tolerance
    double best_share = 0;            // explained by the best alternative
    std::vector<double> shares = {};  // explained by each of AllPoseHypotheses()
    std::optional<RotationPair> rotation = {};
  };
  // A pair that agrees with the given poses, for further checks.
  struct AgreeingPair {
    uint64_t first_frame_id = 0;
    SE3<Camera, Camera> T_second_first = {};
    std::vector<TwoViewMatch> matches = {};

    // From the given poses. nullopt: the camera did not move, or there are no matches.
    std::optional<Motion> GivenMotion() const;
  };

  explicit PoseCheck(const SlamConfig& config) : config_(config) {}

  // Call for each frame with a given pose whose features are known. Returns the frame with an earlier one, if the image
  // moved at least a little and the poses agree.
  std::optional<AgreeingPair> AddFrame(const std::shared_ptr<const FrameFeatures>& frame,
                                       const SE3<World, Camera>& T_world_camera);

  bool IsContradicted() const { return contradicted_since_frame_ != 0; }
  // The first frame of the pairs that contradict the poses; 0: they are not contradicted.
  uint64_t contradicted_since_frame() const { return contradicted_since_frame_; }
  std::optional<Diagnostic> Check() const;

  const std::deque<Pair>& pairs() const { return pairs_; }  // the newest ones, oldest first

 private:
  struct CheckedFrame {
    std::shared_ptr<const FrameFeatures> features;
    SE3<World, Camera> T_world_camera;
  };

  // A frame that matches the reference.
  struct Candidate {
    CheckedFrame second;
    std::vector<TwoViewMatch> matches = {};
    double movement_px = 0;
  };

  void AddPair(const CheckedFrame& first, const Candidate& last);
  // Per match; with more tolerance than for the alternatives.
  std::vector<bool> ExplainedByGiven(const CheckedFrame& first, const Candidate& last) const;
  Pair Judge(const CheckedFrame& first, const Candidate& last) const;
  std::optional<SE3<Camera, Camera>> FindMotion(const Candidate& last) const;
  void Decide();
  uint64_t FrameBefore(std::deque<Pair>::const_iterator pair) const;
  // The hypothesis that explains most of the matches of nearly all pairs, and those that contradict better than all
  // others.
  std::optional<size_t> BestHypothesis() const;
  std::optional<Eigen::Quaterniond> BodyRotation() const;

  const SlamConfig config_;
  std::optional<CheckedFrame> reference_;
  std::optional<Candidate> candidate_;  // the newest one that moved at least a little
  std::deque<Pair> pairs_;
  bool has_older_pairs_ = false;
  std::optional<size_t> best_;  // alternative
  uint64_t contradicted_since_frame_ = 0;
};

}  // namespace romap::slam
