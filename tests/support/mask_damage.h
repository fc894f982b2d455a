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

// All errors are off by default. Shares are probabilities in 0..1.
struct MaskDamage {
  // The whole detector.
  double rate_hz = 0;      // maximum rate; frames in between have no masks. 0 = every frame
  double late_s = 0;       // delay of its masks in time of the frames; 0 = with their frame
  double empty_share = 0;  // of the frames on which it runs but finds nothing
  // Missed objects.
  double drop_share = 0;     // of the masks, independently
  double flicker_share = 0;  // of the time in which an object is missed, for flicker_frames in a row
  int flicker_frames = 10;
  // Wrong outlines.
  double border_px = 0;    // maximum displacement of the borders, smooth along the border
  double merge_share = 0;  // of the frames in which two neighbors get one mask
  double split_share = 0;  // of the masks that become two instances
  double leak_share = 0;   // of the masks that extend beyond the object by a blob, over anything there
  // Wrong detections.
  double class_flip_share = 0;      // of the instances with a wrong class
  double false_positive_share = 0;  // of the time with a false detection, for false_positive_frames in a row
  int false_positive_frames = 4;
  int crowd = 0;  // small blobs are added up to this number of instances
  // Labels are permuted at random in every frame, as by a detector without a tracker.
  bool permute_labels = false;
  uint64_t seed = 1;
};

// Damages the masks of a sequence. The damage of a frame depends on the seed and the frame id alone (rate and delay
// also on the timestamps), and each error is independent of the others. Flicker identifies objects by their labels,
// which therefore have to be the same in every frame.
class MaskDamager {
 public:
  // `class_names`: classes for class flips and false detections. With fewer than two there are no flips.
  MaskDamager(const MaskDamage& damage, std::vector<std::string> class_names);

  // The next frame in order of time with damaged masks. Instances without a pixel are removed from its list.
  std::shared_ptr<const Frame> Damage(const Frame& frame);

  // The next masks that arrive until `now_ns`, oldest first; nullopt when there are none. They belong to earlier
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
  std::optional<int64_t> last_tick_;  // tick of the detector's clock at which it last ran
  std::deque<Waiting> late_;
};

}  // namespace romap
