#pragma once

// Instance masks as bad as real detectors give them: every way they go wrong has a dial.

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/stage_messages.h"

namespace romap {

// All off by default. Shares are probabilities in 0..1, drawn anew for each mask or frame as said.
struct MaskDamage {
  // The whole detector.
  double rate_hz = 0;      // so often it runs at most, on frames in between there are no masks; 0 = on every frame
  double late_s = 0;       // after so much of the frames' time its masks arrive; 0 = with their frame
  double empty_share = 0;  // of the frames on which it runs and finds nothing
  // What it misses.
  double drop_share = 0;     // of the masks, each by itself
  double flicker_share = 0;  // of the time, in which an object is not found for flicker_frames on end
  int flicker_frames = 10;
  // Where one thing ends and the next begins.
  double border_px = 0;    // the borders are displaced by up to so much, smoothly along the border
  double merge_share = 0;  // of the frames in which two neighbours are one mask
  double split_share = 0;  // of the masks that are two instances
  double leak_share = 0;   // of the masks that spill over their border by a blob, onto whatever is there
  // What it believes to see.
  double class_flip_share = 0;  // of the instances that are called something else
  double ghost_share = 0;       // of the time in which a blob is seen where nothing is, for ghost_frames on end
  int ghost_frames = 4;
  int crowd = 0;  // small blobs are added until there are so many instances
  // Labels are renamed at random in every frame: what a detector without a tracker delivers.
  bool permute_labels = false;
  uint64_t seed = 1;
};

// Damages the masks of a sequence. What happens to a frame follows from the seed and the frame's id alone (rate and
// lateness also from the times), and switching one fault on does not change what the others do. Flicker tells objects
// by their labels: for its runs to hit one object they have to be the same from frame to frame.
class MaskDamager {
 public:
  // `class_names`: the names that flips and ghosts choose from; with fewer than two there are no flips.
  MaskDamager(const MaskDamage& damage, std::vector<std::string> class_names);

  // The next frame in order of time with what is left of its masks. An instance without a pixel is not listed.
  std::shared_ptr<const Frame> Damage(const Frame& frame);

  // The next masks that have arrived by `now_ns`, oldest first; nullopt when there are none. They belong to earlier
  // frames, which were handed out without masks. Empty forever unless late_s > 0.
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
  std::optional<int64_t> last_tick_;  // of the detector's clock at which it ran
  std::deque<Waiting> late_;
};

}  // namespace romap
