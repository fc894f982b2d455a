#include "common/build_info/build_info.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "common/version.h"

namespace romap {
namespace {

constexpr std::string_view kCommit =
#include "generated/commit.inc"
    ;

constexpr std::pair<const char*, const char*> kLibraries[] = {
#include "generated/libraries.inc"
};

}  // namespace

std::string BuildInfo(const std::string& program, bool verbose) {
  std::string text = fmt::format("{} {}", program, Version());
  if (!kCommit.empty()) text += fmt::format(" (commit {})", kCommit);
  if (!verbose) return text;
  text += fmt::format("\ncompiler {}", __VERSION__);
  for (const auto& [name, version] : kLibraries) text += fmt::format("\n{} {}", name, version);
  return text;
}

bool HasVerboseFlag(int argc, const char* const* argv) {
  return std::any_of(argv, argv + argc, [](std::string_view word) { return word == "--verbose"; });
}

}  // namespace romap
