#include "client/importers/folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <filesystem>
#include <fstream>

namespace romap::importers {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxDescribed = 8;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// The digits at the start of a text, without leading zeros; moves the text behind them.
std::string_view TakeDigits(std::string_view* text) {
  size_t end = 0;
  while (end < text->size() && IsDigit((*text)[end])) ++end;
  std::string_view digits = text->substr(0, end);
  text->remove_prefix(end);
  const size_t first = digits.find_first_not_of('0');
  return first == std::string_view::npos ? std::string_view() : digits.substr(first);
}

bool HasExtension(const std::string& name, std::string_view extension) {
  if (name.size() < extension.size()) return false;
  return std::equal(extension.begin(), extension.end(), name.end() - static_cast<std::ptrdiff_t>(extension.size()),
                    [](char a, char b) { return std::tolower(a) == std::tolower(b); });
}

std::vector<std::string> NamesIn(const std::string& folder, bool folders) {
  std::vector<std::string> names;
  std::error_code error;
  fs::directory_iterator entry(folder, error), end;
  while (!error && entry != end) {
    std::string name = entry->path().filename().string();
    std::error_code ignored;
    if (entry->is_directory(ignored) == folders && !name.starts_with('.')) names.push_back(std::move(name));
    entry.increment(error);
  }
  std::sort(names.begin(), names.end(), NaturalLess);
  return names;
}

}  // namespace

bool IsFile(const std::string& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

bool IsFolder(const std::string& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

bool NaturalLess(std::string_view a, std::string_view b) {
  const std::string_view whole_a = a, whole_b = b;
  while (!a.empty() && !b.empty()) {
    if (IsDigit(a.front()) && IsDigit(b.front())) {
      const std::string_view x = TakeDigits(&a), y = TakeDigits(&b);
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
    } else {
      if (a.front() != b.front()) return a.front() < b.front();
      a.remove_prefix(1);
      b.remove_prefix(1);
    }
  }
  if (a.empty() != b.empty()) return a.empty();
  return whole_a < whole_b;  // numbers that differ in leading zeros only
}

std::vector<std::string> FileNames(const std::string& folder, std::string_view extension) {
  std::vector<std::string> names = NamesIn(folder, /*folders=*/false);
  std::erase_if(names, [&](const std::string& name) { return !HasExtension(name, extension); });
  return names;
}

std::vector<std::string> FolderNames(const std::string& folder) { return NamesIn(folder, /*folders=*/true); }

std::optional<std::string> FirstExisting(const std::string& folder, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    std::error_code error;
    if (std::string path = folder + "/" + name; fs::exists(path, error)) return path;
  }
  return std::nullopt;
}

std::string StemOf(const std::string& path) { return fs::path(path).stem().string(); }
std::string NameOf(const std::string& path) { return fs::path(path).filename().string(); }

std::optional<int64_t> LastNumber(std::string_view stem) {
  size_t end = stem.size();
  while (end > 0 && !IsDigit(stem[end - 1])) --end;
  size_t begin = end;
  while (begin > 0 && IsDigit(stem[begin - 1])) --begin;
  int64_t number = 0;
  if (begin == end || std::from_chars(stem.data() + begin, stem.data() + end, number).ec != std::errc()) {
    return std::nullopt;
  }
  return number;
}

std::string DescribeSource(const std::string& source) {
  if (!IsFolder(source)) {
    std::ifstream in(source, std::ios::binary);
    char bytes[4] = {};
    in.read(bytes, sizeof(bytes));
    if (std::string_view(bytes, 4) == std::string_view("PK\3\4", 4)) {
      return "a ZIP archive; unpack it first (Record3D's .r3d files contain depth that is compressed with LZFSE, which "
             "is not read: export the recording in another format)";
    }
    return "a file that is no video";
  }
  std::vector<std::string> parts;
  const std::vector<std::string> folders = FolderNames(source), files = FileNames(source);
  for (const std::string& name : folders) parts.push_back(name + "/");
  parts.insert(parts.end(), files.begin(), files.end());
  if (parts.empty()) return "an empty folder";
  const size_t count = parts.size();
  if (count > kMaxDescribed) {
    parts.resize(kMaxDescribed);
    parts.push_back(fmt::format("... ({} entries)", count));
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace romap::importers
