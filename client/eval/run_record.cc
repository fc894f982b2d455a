#include "client/eval/run_record.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "client/files/text_file.h"

namespace romap::eval {
namespace {

std::optional<size_t> Count(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number_unsigned() ? std::optional(found->get<size_t>()) : std::nullopt;
}

}  // namespace

RunRecord ReadRunRecord(const std::string& out_dir) {
  RunRecord record;
  const absl::StatusOr<std::string> text = files::ReadFile(out_dir + "/summary.json");
  if (!text.ok()) return record;
  const nlohmann::json json = nlohmann::json::parse(*text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return record;
  if (const auto poses = json.find("poses"); poses != json.end() && poses->is_string()) record.poses = *poses;
  if (const auto frames = json.find("frames"); frames != json.end() && frames->is_object()) {
    record.first_frame = Count(*frames, "first");
    record.frames_sent = Count(*frames, "sent");
    if (const auto skipped = frames->find("skipped"); skipped != frames->end() && skipped->is_array()) {
      for (const nlohmann::json& id : *skipped) {
        if (id.is_number_unsigned()) record.skipped_frames.push_back(id.get<uint64_t>());
      }
    }
  }
  return record;
}

std::vector<int64_t> FramesOf(const RunRecord& record, const files::Sequence& sequence) {
  const size_t tried = record.frames_sent.value_or(0) + record.skipped_frames.size();
  if (!record.first_frame && tried != sequence.size()) return {};
  const size_t first = std::min(record.first_frame.value_or(0), sequence.size());
  std::vector<int64_t> frames_ns;
  for (size_t k = first; k < std::min(first + tried, sequence.size()); ++k) {
    if (std::ranges::count(record.skipped_frames, k + 1) > 0) continue;
    frames_ns.push_back(sequence.timestamp_ns(k));
  }
  return frames_ns;
}

}  // namespace romap::eval
