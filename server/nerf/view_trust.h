#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/nerf/field_probe.h"

namespace romap::nerf {

// Which views of an object can be believed. A view with a wrong pose, or with the mask of something else, shows what
// all others contradict, and its residual does not fall as theirs do; it is left out for as long as that is so. Nothing
// is doubted while there are few views, nor if many would have to be: then nobody knows which ones are wrong.
class ViewTrust {
 public:
  // The view at `index` is new, or another one than before: it is trusted until it was trained on for a while.
  void OnView(size_t index, uint64_t step);
  // Judges all views by what was seen after `step` steps. True when some view is trusted now that was not, or the other
  // way round.
  bool Judge(const ProbeReport& report, uint64_t step);
  // The field forgot all; so do the verdicts.
  void Restart();

  bool trusted(size_t index) const { return views_[index].trusted; }
  size_t distrusted() const;
  // One per view: 1 trusted, 0 not.
  std::vector<float> Weights() const;

 private:
  struct State {
    uint64_t since_step = 0;
    bool trusted = true;
  };
  // Was trained on for too short a time to be judged.
  bool IsYoung(size_t index, uint64_t step) const;
  std::vector<State> views_;
};

}  // namespace romap::nerf
