#include "client/files/sequence_diagnostics.h"

#include <fmt/format.h>

#include <algorithm>

namespace romap::files {
namespace {

// Below this share of frames with a pose, the poses are probably those of another recording.
constexpr double kUsualPosedShare = 0.5;

double ToSeconds(int64_t time_ns) { return 1e-9 * static_cast<double>(time_ns); }

std::string TimeRange(std::span<const int64_t> times_ns) {
  const auto [first, last] = std::minmax_element(times_ns.begin(), times_ns.end());
  return fmt::format("{:.3f} s to {:.3f} s", ToSeconds(*first), ToSeconds(*last));
}

}  // namespace

Diagnostic TimestampsConverted(std::span<const std::pair<std::string, TimeUnit>> files) {
  std::vector<std::string> parts;
  for (const auto& [file, unit] : files) parts.push_back(fmt::format("{} in {}", file, UnitName(unit)));
  return {.code = "timestamps_converted",
          .severity = Severity::kInfo,
          .count = files.size(),
          .text = fmt::format("timestamps were read as other units than seconds: {}", fmt::join(parts, ", ")),
          .advice = "if this is wrong, write the timestamps in seconds with decimals"};
}

Diagnostic UnmatchedInTime(const std::string& code, const std::string& entries, const std::string& file,
                           std::span<const int64_t> times_ns, std::span<const int64_t> frame_times_ns) {
  return {.code = code,
          .severity = Severity::kWarning,
          .text = fmt::format("none of the {} {} of {} matches a frame in time: {} are from {}, frames from {}",
                              times_ns.size(), entries, file, entries, TimeRange(times_ns), TimeRange(frame_times_ns)),
          .advice = fmt::format("use the same clock in {} and rgb.txt{}", file,
                                entries == "poses" ? "; the camera was tracked from the images instead" : "")};
}

Diagnostic PosesPlaceholder(const std::string& file, size_t rows) {
  return {.code = "poses_placeholder",
          .severity = Severity::kInfo,
          .count = rows,
          .text = fmt::format("{} rows of {} have position 0 0 0 and no rotation, far from the poses around them; they "
                              "are read as \"no pose\"",
                              rows, file),
          .advice = "omit the rows of frames without a pose"};
}

Diagnostic PosesPartial(const std::string& file, size_t posed, size_t frames, uint64_t first_frame_id) {
  const bool usual = static_cast<double>(posed) >= kUsualPosedShare * static_cast<double>(frames);
  return {.code = "poses_partial",
          .severity = usual ? Severity::kInfo : Severity::kWarning,
          .first_frame_id = first_frame_id,
          .count = frames - posed,
          .text = fmt::format("{} has a pose for {} of {} frames; the other frames were sent without one", file, posed,
                              frames),
          .advice = usual ? "" : "check that the poses belong to this recording and use the same clock"};
}

Diagnostic DetectionsUnmatched(const std::string& file, const DetectionFile& detections,
                               const std::vector<bool>& matched, size_t masks_without) {
  size_t rows = 0, unmatched = 0;
  const DetectionSet* first = nullptr;
  for (size_t k = 0; k < detections.sets.size(); ++k) {
    rows += detections.sets[k].rows;
    if (matched[k]) continue;
    unmatched += detections.sets[k].rows;
    if (first == nullptr) first = &detections.sets[k];
  }
  return {
      .code = "detections_unmatched",
      .severity = masks_without > 0 ? Severity::kWarning : Severity::kInfo,
      .count = unmatched,
      .text = fmt::format(
          "{} of {} rows of {} match no mask in time, the first at {:.3f} s in line {}; {}", unmatched, rows, file,
          first == nullptr ? 0 : ToSeconds(first->timestamp_ns), first == nullptr ? 0 : first->line,
          masks_without > 0 ? fmt::format("{} masks have no row", masks_without) : "all masks have rows of their own"),
      .advice = masks_without > 0 ? "use the timestamps of the masks" : ""};
}

Diagnostic DetectionsRepeat(const std::string& file, const DetectionFile& detections) {
  return {
      .code = "detections_repeat",
      .severity = Severity::kInfo,
      .text = fmt::format("{} lists labels several times at one timestamp, each with a single class; its timestamps "
                          "are multiples of {:g} s, and each mask takes the classes of the nearest one",
                          file, ToSeconds(detections.resolution_ns)),
      .advice = "write the timestamps of the masks with all their decimals"};
}

Diagnostic ScoresInPercent(const std::string& file) {
  return {.code = "scores_percent",
          .severity = Severity::kInfo,
          .text = fmt::format("the scores of {} were read as percent, because some are larger than 1", file),
          .advice = "write scores from 0 to 1"};
}

}  // namespace romap::files
