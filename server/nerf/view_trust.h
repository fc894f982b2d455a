#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/nerf/field_probe.h"

namespace romap::nerf {

// Detects views that contradict the others, because of a wrong pose or the mask of another object: their residuals do
// not decrease with those of the other views. Such views are not trusted, and are excluded from training until their
// residuals are normal again. All views are trusted if there are only a few, or if too many contradict the others,
// because then it is unknown which ones are wrong.
class ViewTrust {
 public:
  // The view at `index` is new or was replaced. It is trusted until it has been trained on for some steps.
  void OnView(size_t index, uint64_t step);
  // Updates the trust in all views from their residuals after `step` steps. True if the trust in any view changed.
  bool Update(const ProbeReport& report, uint64_t step);
  // Trusts all views again, because training restarted.
  void Restart();

  bool trusted(size_t index) const { return views_[index].trusted; }
  // One per view: 1 trusted, 0 not.
  std::vector<float> Weights() const;

 private:
  struct State {
    uint64_t since_step = 0;
    bool trusted = true;
  };
  // Whether the view has been trained on for too few steps to be compared with the others.
  bool IsNew(size_t index, uint64_t step) const;

  std::vector<State> views_;
};

}  // namespace romap::nerf
