#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/diagnostic.h"
#include "common/stage_messages.h"
#include "server/masks/mask_image_check.h"
#include "server/masks/mask_thumbnail.h"
#include "server/masks/scene_motion.h"

namespace romap::masks {

// Decides what each mask of a session shows. Masks of objects stay as they are. Masks of the background (table, floor,
// wall) get label 0: they hide nothing that lies in front of them. Masks of what moves with the camera, and the label
// 255 where it means "ignore", get kIgnoreLabel: what is behind them is not known. See BackgroundSign and
// SceneMotion for the evidence.
//
// A mask is followed from frame to frame by its overlap, because labels are valid for one frame only. Its role is
// decided after a few frames, before an object can be confirmed, and the masks that showed no object are listed in
// Frame::non_objects, so that landmarks born from earlier masks can be removed. Not thread-safe.
class MaskInterpreter {
 public:
  // Call for every frame in order, after decoding. `eight_bit`: the mask was an 8-bit image. The pixels of `labels` may
  // be changed in place.
  void Interpret(bool eight_bit, Frame* frame);
  // The masks of an earlier frame.
  void Interpret(bool eight_bit, FrameMasks* masks);

  // How the masks were read, if that is not obvious.
  std::vector<Diagnostic> Diagnostics() const;

 private:
  enum class Role { kObject, kBackground, kCameraFixed };

  // A mask that is followed from frame to frame.
  struct FollowedMask {
    uint16_t label = 0;  // in `previous_`
    std::string class_name;
    int frames = 0;
    int like_background = 0;           // of these
    bool may_move_with_camera = true;  // in the newest frame
    Role role = Role::kObject;
  };
  // A Diagnostic whose text begins with the classes of the masks, if any.
  struct Finding {
    std::string code = {};
    Severity severity = Severity::kInfo;
    uint64_t first_frame_id = 0;
    uint64_t count = 0;
    std::string text = {};
    std::string advice = {};
    std::set<std::string> classes = {};  // the first of them
    bool has_more_classes = false;
  };
  // Masks of one class, followed or not.
  struct ClassEvidence {
    int masks = 0;
    int like_background = 0;  // of these
  };

  std::vector<NonObjectMask> InterpretLabels(uint64_t frame_id, const cv::Mat& gray, bool eight_bit, cv::Mat* labels,
                                             std::vector<Instance>* instances);
  void IgnoreVoid(uint64_t frame_id, cv::Mat* labels, std::vector<Instance>* instances);
  void IgnoreRegion(uint64_t frame_id, const MaskThumbnail& thumbnail, const cv::Mat& region, cv::Mat* labels);
  std::vector<FollowedMask> Follow(const MaskThumbnail& thumbnail, const std::vector<Instance>& instances);
  FollowedMask Begin(uint16_t label, const std::string& class_name) const;
  void Decide(uint64_t frame_id, const MaskThumbnail& thumbnail, FollowedMask* mask);
  void CountBackground(uint64_t frame_id, const MaskThumbnail& thumbnail);
  std::optional<Diagnostic> MissingBackground() const;
  void Note(uint64_t frame_id, const Finding& finding);

  bool void_is_ignored_ = false;
  MaskThumbnail previous_;
  std::vector<FollowedMask> followed_;            // the masks of `previous_`
  std::map<std::string, ClassEvidence> classes_;  // by class name, without "object"; of the first kMaxClasses
  SceneMotion scene_motion_;
  uint64_t mask_frames_ = 0;
  uint64_t frames_without_background_ = 0;       // of these
  uint64_t first_frame_without_background_ = 0;  // frame id
  MaskImageCheck image_check_;
  std::deque<std::pair<uint64_t, cv::Mat>> waiting_;  // frame id and MakeGray() of recent frames without masks
  std::map<std::string, Finding> findings_;           // by code
};

}  // namespace romap::masks
