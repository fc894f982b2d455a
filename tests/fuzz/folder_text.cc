#include "tests/fuzz/folder_text.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "tests/fuzz/repair.h"

namespace romap::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMark = "=== ";
constexpr int kMaxFiles = 64;

bool IsSafeName(std::string_view name) {
  const auto is_usual = [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '.' || c == '_' ||
           c == '-' || c == '/';
  };
  return !name.empty() && name.size() < 100 && std::ranges::all_of(name, is_usual) && name.front() != '/' &&
         name.back() != '/' && name.find("..") == std::string_view::npos;
}

// The position of the next mark at the beginning of a line, or the end.
size_t NextMark(std::string_view text, size_t begin) {
  while (true) {
    const size_t found = text.find(kMark, begin);
    if (found == std::string_view::npos) return text.size();
    if (found == 0 || text[found - 1] == '\n') return found;
    begin = found + 1;
  }
}

}  // namespace

std::string FolderAsText(const std::string& path, size_t max_file_bytes) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(path)) {
    if (entry.is_regular_file() && entry.file_size() <= max_file_bytes) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  std::string text;
  for (const fs::path& file : files) {
    std::ifstream stream(file, std::ios::binary);
    text += std::string(kMark) + fs::relative(file, path).string() + "\n";
    text.append(std::istreambuf_iterator<char>(stream), {});
    text += "\n";
  }
  return text;
}

void WriteFolder(std::string_view text, const ScratchFolder& folder, bool repair_png) {
  folder.Clear();
  size_t mark = NextMark(text, 0);
  for (int files = 0; mark < text.size() && files < kMaxFiles; ++files) {
    const size_t end = NextMark(text, mark + kMark.size());
    const std::string_view part = text.substr(mark + kMark.size(), end - mark - kMark.size());
    const size_t line_end = std::min(part.find('\n'), part.size());
    const std::string_view name = part.substr(0, line_end);
    std::string content(part.substr(std::min(line_end + 1, part.size())));
    if (content.ends_with('\n')) content.pop_back();
    if (repair_png) RepairPng(&content);
    if (IsSafeName(name)) folder.Write(name, content);
    mark = end;
  }
}

}  // namespace romap::fuzz
