#include "client/synth/options.h"

#include <algorithm>
#include <charconv>
#include <string>

namespace romap::synth {

absl::StatusOr<FrameRange> ParseFrameRange(const std::string& text) {
  FrameRange range;
  const char* const end = text.data() + text.size();
  const auto [colon, error] = std::from_chars(text.data(), end, range.first);
  if (error == std::errc() && colon != end && *colon == ':') {
    const auto [rest, last_error] = std::from_chars(colon + 1, end, range.last);
    if (last_error == std::errc() && rest == end) return range;
  }
  return InvalidArgument("'{}': expected FIRST:LAST, two frame numbers from 1, e.g. 100:130", text);
}

absl::Status ValidateSynthOptions(const SynthOptions& options) {
  std::string faults;
  const auto require = [&](const char* name, double value, double low, double high) {
    if (value >= low && value <= high) return;  // false for NaN
    faults += fmt::format("{}{} is {}; expected {}..{}", faults.empty() ? "" : "; ", name, value, low, high);
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
  require("hand_motion", options.hand_motion, 0, 4);
  require("exposure_stops", options.exposure_stops, 0, 4);
  require("duplicate_share", options.duplicate_share, 0, 1);
  const auto require_ranges = [&](const char* name, const std::vector<FrameRange>& ranges) {
    for (const FrameRange& range : ranges) {
      if (range.first >= 1 && range.first <= range.last && range.last <= options.frames) continue;
      faults += fmt::format("{}{} is {}:{}; expected an increasing range within 1:{}", faults.empty() ? "" : "; ", name,
                            range.first, range.last, options.frames);
    }
  };
  require_ranges("cut", options.cuts);
  require_ranges("black", options.black);
  require_ranges("blurred", options.blurred);
  bool any_frame = false;
  for (int number = 1; number <= options.frames && !any_frame; ++number) {
    any_frame = std::none_of(options.cuts.begin(), options.cuts.end(),
                             [&](const FrameRange& range) { return range.Contains(number); });
  }
  if (options.frames > 0 && !any_frame) faults += fmt::format("{}cut removes all frames", faults.empty() ? "" : "; ");
  if (faults.empty()) return absl::OkStatus();
  return InvalidArgument("synthetic sequence: {}", faults);
}

}  // namespace romap::synth
