#include "client/synth/options.h"

#include <string>

namespace romap::synth {

absl::Status ValidateSynthOptions(const SynthOptions& options) {
  std::string faults;
  const auto require = [&](const char* name, double value, double low, double high) {
    if (value >= low && value <= high) return;  // false for NaN
    faults += fmt::format("{}{} = {} is not in {}..{}", faults.empty() ? "" : "; ", name, value, low, high);
  };
  require("objects", options.objects, 1, 16);
  require("identical_pairs", options.identical_pairs, 0, options.objects / 2);
  require("frames", options.frames, 1, 100000);
  require("fps", options.fps, 0.1, 1000);
  require("rounds", options.rounds, 0.01, 100);
  require("elevation_deg", options.elevation_deg, 5, 80);
  require("width_px", options.width_px, 32, 4096);
  require("height_px", options.height_px, 32, 4096);
  require("mask_jitter_px", options.mask_jitter_px, 0, 50);
  require("mask_drop_share", options.mask_drop_share, 0, 1);
  require("noise_sigma", options.noise_sigma, 0, 100);
  require("motion_blur_px", options.motion_blur_px, 0, 100);
  require("defocus_px", options.defocus_px, 0, 20);
  if (faults.empty()) return absl::OkStatus();
  return InvalidArgument("synthetic sequence: {}", faults);
}

}  // namespace romap::synth
