#pragma once

// Instance masks with the errors of real detectors, each with a parameter.

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/stage_messages.h"

namespace romap {

// Parameters of the errors. All errors are off by default. Shares are probabilities, 0..1.
struct MaskDamage {
  // The whole detector.
  double rate_hz = 0;      // maximum rate of frames with masks; 0 = unlimited
  double late_s = 0;       // delay of the masks, by frame timestamps; 0 = with their frame
  double empty_share = 0;  // share of the processed frames without any detection
  // Missed objects.
  double drop_share = 0;     // share of the masks that are missing, each independently
  double flicker_share = 0;  // share of the frames in which an object is missing, in runs of flicker_frames
  int flicker_frames = 10;
  // Wrong outlines.
  double border_px = 0;    // maximum displacement of the borders, smooth along the border
  double merge_share = 0;  // share of the frames in which two neighbors have one mask
  double split_share = 0;  // share of the masks that are split into two instances
  double leak_share = 0;   // share of the masks with a blob across their border, which covers other masks too
  // Wrong detections.
  double class_flip_share = 0;      // share of the instances with a wrong class
  double false_positive_share = 0;  // share of the frames with a false detection, in runs of false_positive_frames
  int false_positive_frames = 4;
  int crowd = 0;  // number of instances to reach by adding small blobs
  // Permutes the labels at random in every frame, like a detector without a tracker.
  bool permute_labels = false;
  uint64_t seed = 1;
};

// Damages the masks of a sequence. The damage of a frame depends only on the seed and the frame id (rate and delay
// also on the timestamps), and each error is independent of the others. Flicker identifies objects by their labels,
// so the labels of the input must be the same in every frame.
class MaskDamager {
 public:
  // `class_names`: classes for class flips and false detections. With fewer than two, classes are not flipped.
  MaskDamager(const MaskDamage& damage, std::vector<std::string> class_names);

  // Returns the frame with damaged masks. Call in order of time. Removes instances without a pixel.
  std::shared_ptr<const Frame> Damage(const Frame& frame);

  // Returns the oldest late masks that arrive by `now_ns`; nullopt if there are none. They belong to earlier
  // frames, which were returned without masks. Only with late_s > 0.
  std::optional<FrameMasks> TakeLateMasks(int64_t now_ns);

 private:
  struct Waiting {
    int64_t arrival_ns = 0;
    FrameMasks masks;
  };

  bool DetectorRuns(const Frame& frame);
  FrameMasks DamagedMasks(const Frame& frame) const;

  MaskDamage damage_;
  std::vector<std::string> class_names_;
  std::optional<int64_t> last_tick_;  // tick of the detector's clock in which it last ran
  std::deque<Waiting> late_;
};

}  // namespace romap
