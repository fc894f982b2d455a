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

std::optional<Diagnostic> UnreadableFiles::FirstOf(files::FileKind kind, uint64_t frame_id) const {
  const Kind& files = kinds_[static_cast<size_t>(kind)];
  if (files.unreadable != 1 || files.first_frame_id != frame_id) return std::nullopt;
  return DiagnosticOf(kind);
}

Diagnostic UnreadableFiles::DiagnosticOf(files::FileKind kind) const {
  const Kind& files = kinds_[static_cast<size_t>(kind)];
  const KindText& texts = kKindTexts[static_cast<size_t>(kind)];
  return {.code = "file_unreadable",
          .severity = Severity::kWarning,
          .first_frame_id = files.first_frame_id,
          .count = files.unreadable,
          .text = fmt::format("{} of {} {} cannot be read, the first: {}", files.unreadable, files.listed, texts.plural,
                              files.first_reason),
          .advice = fmt::format("{}; replace the files", texts.consequence)};
}

std::vector<Diagnostic> UnreadableFiles::Diagnostics() const {
  std::vector<Diagnostic> diagnostics;
  for (size_t index = 0; index < kinds_.size(); ++index) {
    if (kinds_[index].unreadable > 0) diagnostics.push_back(DiagnosticOf(static_cast<files::FileKind>(index)));
  }
  return diagnostics;
}

}  // namespace romap::cli
