#include "server/session/unlisted_labels.h"

#include <fmt/format.h>

#include "common/label_image.h"

namespace romap::session {
namespace {

constexpr uint16_t kVoidOfEightBits = 255;

std::vector<bool> FindLabels(const cv::Mat& labels) {
  std::vector<bool> present(65536, false);
  for (int y = 0; y < labels.rows; ++y) {
    const auto* row = labels.ptr<uint16_t>(y);
    for (int x = 0; x < labels.cols; ++x) present[row[x]] = true;
  }
  return present;
}

}  // namespace

void UnlistedLabels::Add(uint64_t frame_id, bool eight_bit, const cv::Mat& labels, std::vector<Instance>* instances) {
  std::vector<bool> present = FindLabels(labels);
  present[0] = present[kIgnoreLabel] = false;
  std::vector<bool> listed(65536, false);
  uint32_t absent = 0;
  for (const Instance& instance : *instances) {
    listed[instance.label] = true;
    if (absent == 0 && !present[instance.label]) absent = instance.label;
  }
  has_classes_ |= !instances->empty();
  std::vector<uint16_t> unlisted;
  size_t labels_present = 0;
  for (size_t label = 1; label < present.size(); ++label) {
    labels_present += present[label] ? 1 : 0;
    if (!present[label] || listed[label]) continue;
    unlisted.push_back(static_cast<uint16_t>(label));
    instances->push_back(
        {.label = static_cast<uint32_t>(label), .class_name = "object", .score = 1.0, .track_id = std::nullopt});
  }
  ++masks_;
  const bool is_void = eight_bit && labels_present > 1;
  if (is_void) std::erase(unlisted, kVoidOfEightBits);
  if (unlisted.empty()) return;
  if (count_++ > 0) return;
  first_frame_id_ = frame_id;
  first_label_ = unlisted.front();
  first_absent_ = absent;
}

std::optional<Diagnostic> UnlistedLabels::Check() const {
  if (!has_classes_ || count_ == 0) return std::nullopt;
  return Diagnostic{
      .code = "labels_without_class",
      .severity = 2 * count_ > masks_ ? Severity::kWarning : Severity::kInfo,
      .first_frame_id = first_frame_id_,
      .count = count_,
      .text =
          fmt::format("{} of {} masks have labels without a class (the first: label {} in frame {}{}); they are "
                      "mapped as class \"object\"",
                      count_, masks_, first_label_, first_frame_id_,
                      first_absent_ > 0 ? fmt::format(", where the listed label {} has no pixel", first_absent_) : ""),
      .advice = "list every label of a mask with its class and the timestamp of the mask (detections.csv)"};
}

}  // namespace romap::session
