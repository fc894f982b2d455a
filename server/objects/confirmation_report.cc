#include "server/objects/confirmation_report.h"

#include <fmt/format.h>

namespace romap::objects {

void ConfirmationReport::CountMaskedFrame(bool has_pose) {
  ++masked_frames_;
  if (has_pose) ++frames_with_pose_;
}

std::optional<Diagnostic> ConfirmationReport::Check(const ObjectsConfig& config) const {
  if (confirmed_ > 0 || masked_frames_ == 0) return std::nullopt;
  Diagnostic diagnostic{.code = "no_object_confirmed"};
  if (frames_with_pose_ == 0) {
    diagnostic.text =
        fmt::format("no object was mapped: {} frames have masks, but none of them has a camera pose", masked_frames_);
    return diagnostic;
  }
  diagnostic.text =
      fmt::format("no object was mapped from {} frames with masks and a camera pose: ", frames_with_pose_);
  if (unconfirmed_.empty()) {
    diagnostic.text += "no mask showed one place of the scene in several frames";
  } else {
    std::string reasons;
    for (const auto& [reason, count] : unconfirmed_) {
      if (!reasons.empty()) reasons += ", ";
      reasons += fmt::format("{} ({})", reason, count);
    }
    diagnostic.text += "the candidates were not confirmed: " + reasons;
  }
  diagnostic.advice = fmt::format(
      "show each object whole in at least {} frames and {} keyframes, from directions at least {:.0f} degrees apart",
      config.confirm_frames, config.confirm_keyframes, config.confirm_parallax_deg);
  return diagnostic;
}

}  // namespace romap::objects
