#include "client/files/file_list.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include "client/files/text_file.h"

namespace romap::files {
namespace {

constexpr std::string_view kListBlanks = " \t";

// Splits 'timestamp filename'. nullopt: malformed.
std::optional<std::pair<std::string, std::string>> SplitEntry(const std::string& line) {
  const size_t end = line.find_first_of(kListBlanks);
  if (end == std::string::npos) return std::nullopt;
  std::string name = line.substr(line.find_first_not_of(kListBlanks, end));
  if (name.starts_with('"')) {
    const size_t quote = name.find('"', 1);
    if (quote == std::string::npos) return std::nullopt;
    const size_t rest = name.find_first_not_of(kListBlanks, quote + 1);
    if (rest != std::string::npos && name[rest] != '#') return std::nullopt;
    name = name.substr(1, quote - 1);
  } else {
    for (const char* comment : {" #", "\t#"}) name = name.substr(0, name.find(comment));
    name = name.substr(0, name.find_last_not_of(kListBlanks) + 1);
  }
  if (name.empty() || name.starts_with('#')) return std::nullopt;
  return std::pair(line.substr(0, end), name);
}

absl::Status CheckFilesExist(const FileList& list, const std::vector<TextLine>& lines, const std::string& path) {
  size_t missing = 0;
  std::string first;
  for (size_t k = 0; k < list.files.size(); ++k) {
    std::error_code error;
    if (std::filesystem::is_regular_file(list.files[k].path, error)) continue;
    if (missing++ == 0) first = fmt::format("{}:{}: {}", path, lines[k].number, list.files[k].path);
  }
  if (static_cast<double>(missing) <= kMaxUnreadableShare * static_cast<double>(list.files.size())) {
    return absl::OkStatus();
  }
  return NotFound("{} does not exist; {} of {} listed files are missing", first, missing, list.files.size());
}

}  // namespace

absl::StatusOr<FileList> ReadFileList(const std::string& dir, const std::string& name) {
  const std::string path = dir + "/" + name;
  ROMAP_ASSIGN_OR_RETURN(const std::vector<TextLine> lines, ReadLines(path));
  std::vector<std::string> timestamps, names;
  for (const TextLine& line : lines) {
    const auto entry = SplitEntry(line.text);
    if (!entry || !ParseNumber(entry->first)) {
      return InvalidArgument("{}:{}: expected 'timestamp filename'", path, line.number);
    }
    timestamps.push_back(entry->first);
    names.push_back(entry->second);
  }
  FileList list{.files = {}, .unit = DetectTimeUnit(timestamps)};
  for (size_t k = 0; k < lines.size(); ++k) {
    const std::optional<int64_t> timestamp_ns = ParseTimestamp(timestamps[k], list.unit);
    if (!timestamp_ns) {
      return InvalidArgument("{}:{}: timestamp {} is out of range in {}; expected seconds", path, lines[k].number,
                             timestamps[k], UnitName(list.unit));
    }
    if (!list.files.empty() && *timestamp_ns <= list.files.back().timestamp_ns) {
      return InvalidArgument("{}:{}: timestamps must increase; got {} after {}", path, lines[k].number, timestamps[k],
                             timestamps[k - 1]);
    }
    list.files.push_back({*timestamp_ns, dir + "/" + names[k]});
  }
  ROMAP_RETURN_IF_ERROR(CheckFilesExist(list, lines, path));
  return list;
}

}  // namespace romap::files
