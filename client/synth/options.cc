#include "client/synth/options.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>

namespace romap::synth {

namespace {

// Parses numbers that are separated by colons. nullopt if malformed.
template <size_t kCount>
std::optional<std::array<double, kCount>> ParseNumbers(const std::string& text) {
  std::array<double, kCount> numbers;
  const char* next = text.data();
  const char* const end = text.data() + text.size();
  for (size_t i = 0; i < kCount; ++i) {
    if (i > 0 && (next == end || *next++ != ':')) return std::nullopt;
    const auto [stop, error] = std::from_chars(next, end, numbers[i]);
    if (error != std::errc()) return std::nullopt;
    next = stop;
  }
  if (next != end) return std::nullopt;
  return numbers;
}

}  // namespace

absl::StatusOr<FrameRange> ParseFrameRange(const std::string& text) {
  FrameRange range;
  const char* const end = text.data() + text.size();
  const auto [colon, error] = std::from_chars(text.data(), end, range.first);
  if (error == std::errc() && colon != end && *colon == ':') {
    const auto [stop, last_error] = std::from_chars(colon + 1, end, range.last);
    if (last_error == std::errc() && stop == end) return range;
  }
  return InvalidArgument("'{}': expected FIRST:LAST, two frame numbers from 1, e.g. 100:130", text);
}

absl::StatusOr<ImageCrop> ParseImageCrop(const std::string& text) {
  ImageCrop crop;
  const std::optional<std::array<double, 4>> numbers = ParseNumbers<4>(text);
  if (!numbers ||
      std::any_of(numbers->begin(), numbers->end(), [](double n) { return n < 0 || n > 4096 || n != std::floor(n); })) {
    return InvalidArgument("'{}': expected X:Y:WIDTH:HEIGHT in pixels, e.g. 160:120:320:240", text);
  }
  return ImageCrop{static_cast<int>((*numbers)[0]), static_cast<int>((*numbers)[1]), static_cast<int>((*numbers)[2]),
                   static_cast<int>((*numbers)[3])};
}

absl::StatusOr<GainRange> ParseGainRange(const std::string& text) {
  const std::optional<std::array<double, 2>> numbers = ParseNumbers<2>(text);
  if (!numbers) return InvalidArgument("'{}': expected LOW:HIGH, two factors, e.g. 0.3:1.6", text);
  return GainRange{(*numbers)[0], (*numbers)[1]};
}

absl::StatusOr<TableTexture> ParseTableTexture(const std::string& text) {
  if (text == "distinct") return TableTexture{};
  if (text == "plain") return TableTexture{.kind = TableTexture::Kind::kPlain};
  if (text == "faint") return TableTexture{.kind = TableTexture::Kind::kFaint};
  constexpr std::string_view kRepeat = "repeat:";
  if (text.starts_with(kRepeat)) {
    TableTexture table{.kind = TableTexture::Kind::kRepeated};
    const char* const end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data() + kRepeat.size(), end, table.repeats);
    if (error == std::errc() && stop == end) return table;
  }
  return InvalidArgument("'{}': expected distinct, repeat:N, plain or faint, e.g. repeat:2", text);
}

absl::StatusOr<CameraJump> ParseCameraJump(const std::string& text) {
  const std::optional<std::array<double, 2>> numbers = ParseNumbers<2>(text);
  if (numbers && (*numbers)[0] >= 1 && (*numbers)[0] <= 1e6 && (*numbers)[0] == std::floor((*numbers)[0])) {
    return CameraJump{static_cast<int>((*numbers)[0]), (*numbers)[1]};
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
  if (options.fx_px != 0) require("fx_px", options.fx_px, 10, 100000);
  if (options.fy_px != 0) require("fy_px", options.fy_px, 10, 100000);
  if (options.crop != ImageCrop{}) {
    require("crop.x_px", options.crop.x_px, 0, options.width_px - 32);
    require("crop.y_px", options.crop.y_px, 0, options.height_px - 32);
    require("crop.width_px", options.crop.width_px, 32, options.width_px - options.crop.x_px);
    require("crop.height_px", options.crop.height_px, 32, options.height_px - options.crop.y_px);
  }
  require("readout", options.readout, 0, 1);
  require("exposure", options.exposure, 0, 1);
  require("jpeg_quality", options.jpeg_quality, 1, 100);
  require("gripper_share", options.gripper_share, 0, 0.9);
  require("occluder_share", options.occluder_share, 0, 0.9);
  require("gain_steps.low", options.gain_steps.low, 0.01, 100);
  require("gain_steps.high", options.gain_steps.high, options.gain_steps.low, 100);
  require("depth_noise_mm", options.depth_noise_mm, 0, 100);
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
