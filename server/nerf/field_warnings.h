#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "common/ids.h"

namespace romap::nerf {

// Collects problems with the input of one object and describes them in a human-readable text.
class FieldWarnings {
 public:
  // The result of checks on all views of the object.
  struct ViewChecks {
    int views = 0;
    int black_views = 0;                // those whose object pixels are black
    int mask_border_px = 0;             // see InputQuality
    bool depth_consistent = true;       // dense depth agrees with the masks, or there is none
    double share_intersecting_box = 1;  // share of the rays through the masks that intersect the box
  };

  // The result of setting the last box. An OK status clears the warning.
  void OnBox(const absl::Status& status);
  void OnRejectedView(const absl::Status& status);
  void OnInvalidCorrection() { invalid_correction_ = true; }
  void OnViewChecks(const ViewChecks& checks) { checks_ = checks; }

  // All warnings, separated by "; ". Empty if there are none. `divergences`: number of times that training diverged
  // before it was paused; 0 if it is not paused. `untrusted`: the views that are excluded from training.
  std::string Text(int divergences, const std::vector<KeyframeId>& untrusted) const;

 private:
  std::string box_error_;   // of the last box
  std::string view_error_;  // of the last rejected view
  int rejected_views_ = 0;
  bool invalid_correction_ = false;
  ViewChecks checks_;
};

}  // namespace romap::nerf
