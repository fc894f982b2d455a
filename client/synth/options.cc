#include "client/synth/options.h"

#include <algorithm>
#include <charconv>
#include <string>
#include <string_view>

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

absl::StatusOr<TableTexture> ParseTableTexture(const std::string& text) {
  if (text == "distinct") return TableTexture{};
  if (text == "plain") return TableTexture{.kind = TableTexture::Kind::kPlain};
  if (text == "faint") return TableTexture{.kind = TableTexture::Kind::kFaint};
  constexpr std::string_view kRepeat = "repeat:";
  if (text.starts_with(kRepeat)) {
    TableTexture table{.kind = TableTexture::Kind::kRepeated};
    const char* const end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data() + kRepeat.size(), end, table.repeats);
    if (error == std::errc() && rest == end) return table;
  }
  return InvalidArgument("'{}': expected distinct, repeat:N, plain or faint, e.g. repeat:2", text);
}

absl::StatusOr<CameraJump> ParseCameraJump(const std::string& text) {
  CameraJump jump;
  const char* const end = text.data() + text.size();
  const auto [colon, error] = std::from_chars(text.data(), end, jump.frame);
  if (error == std::errc() && colon != end && *colon == ':') {
    const auto [rest, turn_error] = std::from_chars(colon + 1, end, jump.turn_deg);
    if (turn_error == std::errc() && rest == end && jump.frame >= 1) return jump;
  }
  return InvalidArgument("'{}': expected FRAME:DEGREES, a frame number from 1 and an angle, e.g. 150:180", text);
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
  require("arc_deg", options.arc_deg, 0, 36000);
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
  require("rotation.first_frames", options.rotation.first_frames, 0, options.frames);
  require("rotation.speed_deg", options.rotation.speed_deg, 0.01, 30);
  require("rotation.range_deg", options.rotation.range_deg, 1, 90);
  require("rotation.sway_mm", options.rotation.sway_mm, 0, 500);
  require("shake_deg", options.shake_deg, 0, 30);
  require("shake_mm", options.shake_mm, 0, 200);
  require("jump.frame", options.jump.frame, 0, options.frames);
  require("jump.turn_deg", options.jump.turn_deg, -360, 360);
  require("surroundings.table.repeats", options.surroundings.table.repeats, 1, 100);
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
