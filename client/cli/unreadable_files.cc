#include "client/cli/unreadable_files.h"

#include <fmt/format.h>

#include "common/status.h"

namespace romap::cli {
namespace {

struct KindText {
  const char* plural;
  const char* consequence;
};
// By files::FileKind.
constexpr std::array<KindText, 3> kKindTexts = {{{"images", "these frames were not sent"},
                                                 {"masks", "these frames were sent without masks"},
                                                 {"depth images", "these frames were sent without depth"}}};

}  // namespace

UnreadableFiles::UnreadableFiles(const files::Sequence& sequence, size_t first, size_t end) {
  for (size_t k = first; k < end; ++k) {
    const files::FramePaths& paths = sequence.paths(k);
    ++kinds_[static_cast<size_t>(files::FileKind::kImage)].listed;
    if (!paths.mask.empty()) ++kinds_[static_cast<size_t>(files::FileKind::kMask)].listed;
    if (!paths.depth.empty()) ++kinds_[static_cast<size_t>(files::FileKind::kDepth)].listed;
  }
}

absl::Status UnreadableFiles::Note(uint64_t frame_id, const files::UnreadableFile& file) {
  const auto index = static_cast<size_t>(file.kind);
  Kind& kind = kinds_[index];
  if (kind.unreadable++ == 0) {
    kind.first_frame_id = frame_id;
    kind.first_reason = Message(file.reason);
  }
  if (file.kind == files::FileKind::kImage) skipped_frames_.push_back(frame_id);
  if (static_cast<double>(kind.unreadable) <= files::kMaxUnreadableShare * static_cast<double>(kind.listed)) {
    return absl::OkStatus();
  }
  return absl::Status(
      file.reason.code(),
      fmt::format("at least {} of {} {} cannot be read; at most {:.0f} % may be unreadable. The first: {}",
                  kind.unreadable, kind.listed, kKindTexts[index].plural, 100 * files::kMaxUnreadableShare,
                  kind.first_reason));
}

std::vector<Diagnostic> UnreadableFiles::Diagnostics() const {
  std::vector<Diagnostic> diagnostics;
  for (size_t index = 0; index < kinds_.size(); ++index) {
    const Kind& kind = kinds_[index];
    if (kind.unreadable == 0) continue;
    diagnostics.push_back({.code = "file_unreadable",
                           .severity = Severity::kWarning,
                           .first_frame_id = kind.first_frame_id,
                           .count = kind.unreadable,
                           .text = fmt::format("{} of {} {} cannot be read, the first: {}", kind.unreadable,
                                               kind.listed, kKindTexts[index].plural, kind.first_reason),
                           .advice = fmt::format("{}; replace the files", kKindTexts[index].consequence)});
  }
  return diagnostics;
}

}  // namespace romap::cli
