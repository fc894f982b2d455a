// Keeps the folders what they are: what each may include, how long files get, and that nothing names a machine.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <string>
#include <vector>

namespace romap::house {
namespace {

namespace fs = std::filesystem;

struct SourceFile {
  std::string path;  // relative to the source tree
  std::vector<std::string> lines;
};

std::vector<SourceFile> SourceFiles() {
  std::vector<SourceFile> files;
  for (const char* top : {"common", "server", "client", "tests"}) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(ROMAP_SOURCE_DIR) / top)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".h" && extension != ".cc" && extension != ".cu" && extension != ".cuh") continue;
      SourceFile file{fs::relative(entry.path(), ROMAP_SOURCE_DIR).string(), {}};
      std::ifstream stream(entry.path());
      for (std::string line; std::getline(stream, line);) file.lines.push_back(line);
      files.push_back(std::move(file));
    }
  }
  return files;
}

// The longest key that the path begins with decides.
const std::map<std::string, std::vector<std::string>> kMayInclude = {
    {"common/", {"common/"}},
    {"common/wire/", {"common/", "romap/v1/"}},
    {"server/slam/", {"server/slam/", "common/"}},
    {"server/slam/features/", {"server/slam/features/", "server/slam/slam_config.h", "common/"}},
    {"server/slam/geometry/", {"server/slam/geometry/", "common/"}},
    {"server/slam/optimize/", {"server/slam/optimize/", "common/"}},
    {"server/slam/places/", {"server/slam/places/", "server/slam/features/", "server/slam/slam_config.h", "common/"}},
    {"server/hull/", {"server/hull/", "common/"}},
    {"server/objects/", {"server/objects/", "server/hull/", "common/"}},
    {"server/objects/lines/", {"server/objects/lines/", "common/"}},
    {"server/nerf/", {"server/nerf/", "server/hull/", "common/"}},
    // The back ends share math/ and model/ and do not include each other.
    {"server/nerf/math/", {"server/nerf/math/"}},
    {"server/nerf/model/", {"server/nerf/model/", "server/nerf/math/", "server/nerf/nerf_config.h", "common/"}},
    {"server/nerf/cpu/",
     {"server/nerf/cpu/", "server/nerf/model/", "server/nerf/math/", "server/nerf/nerf_config.h",
      "server/nerf/train_stats.h", "server/nerf/trainer.h", "common/"}},
    {"server/nerf/cuda/",
     {"server/nerf/cuda/", "server/nerf/model/", "server/nerf/math/", "server/nerf/nerf_config.h",
      "server/nerf/train_stats.h", "server/nerf/trainer.h", "common/"}},
    {"server/mesh/", {"server/mesh/", "common/"}},
    {"server/session/", {"server/", "common/"}},
    {"server/transport/", {"server/transport/", "server/session/", "common/", "romap/v1/"}},
    {"server/main.cc", {"server/", "common/"}},
    {"client/files/", {"client/files/", "common/"}},
    {"client/eval/", {"client/eval/", "client/files/", "common/"}},
    {"client/render/", {"client/render/", "common/"}},
    {"client/synth/", {"client/synth/", "client/render/", "client/files/", "common/"}},
    {"client/pictures/", {"client/pictures/", "client/render/", "common/"}},
    {"client/sdk/", {"client/sdk/", "common/", "romap/v1/"}},
    {"client/bench/",
     {"client/bench/", "client/eval/", "client/files/", "server/session/", "server/nerf/", "server/mesh/", "common/"}},
    {"client/cli/", {"client/", "server/session/", "common/"}},
    {"tests/", {"common/", "server/", "client/", "tests/", "romap/v1/"}},
};

const std::vector<std::string>& Allowed(const std::string& path) {
  const std::vector<std::string>* best = nullptr;
  size_t length = 0;
  for (const auto& [prefix, allowed] : kMayInclude) {
    if (path.starts_with(prefix) && prefix.size() > length) {
      best = &allowed;
      length = prefix.size();
    }
  }
  static const std::vector<std::string> kNothing;
  EXPECT_NE(best, nullptr) << path << " is in no known folder";
  return best == nullptr ? kNothing : *best;
}

TEST(HouseTest, FoldersIncludeOnlyAllowedFolders) {
  const std::regex include(R"(^\s*#include\s+"([^"]+)\")");
  for (const SourceFile& file : SourceFiles()) {
    const std::vector<std::string>& allowed = Allowed(file.path);
    for (const std::string& line : file.lines) {
      std::smatch match;
      if (!std::regex_search(line, match, include)) continue;
      const std::string target = match[1];
      if (target.find('/') == std::string::npos) continue;  // a file of the same folder
      if (target.starts_with("hwy/") || target.starts_with("google/")) continue;
      // The session's pipeline alone knows the stages; transport and the command line know the session only.
      EXPECT_TRUE(
          std::any_of(allowed.begin(), allowed.end(), [&](const std::string& a) { return target.starts_with(a); }))
          << file.path << " must not include " << target;
    }
  }
}

// The headers of client/sdk are installed; users of the library need neither gRPC nor protobuf.
TEST(HouseTest, PublicHeadersOfTheSdkIncludeNoGrpc) {
  const std::regex include(R"(^\s*#include\s+[<"](grpc|google/|romap/v1/|common/wire/|client/sdk/internal/))");
  for (const SourceFile& file : SourceFiles()) {
    const std::filesystem::path path = file.path;
    if (path.parent_path() != "client/sdk" || path.extension() != ".h") continue;
    for (const std::string& line : file.lines) EXPECT_FALSE(std::regex_search(line, include)) << path << ": " << line;
  }
}

// The folder's namespace: nothing of one folder is defined in the namespace of another.
std::string NamespaceOf(const std::string& path) {
  static const std::vector<std::pair<std::string, std::string>> kNamespaces = {
      {"common/wire/", "romap::wire"},
      {"common/", "romap"},
      {"server/slam/", "romap::slam"},
      {"server/objects/", "romap::objects"},
      {"server/nerf/cuda/", "romap::nerf::cuda"},
      {"server/nerf/", "romap::nerf"},
      {"server/mesh/", "romap::mesh"},
      {"server/hull/", "romap::hull"},
      {"server/session/", "romap::session"},
      {"server/transport/", "romap::transport"},
      {"client/files/", "romap::files"},
      {"client/eval/", "romap::eval"},
      {"client/render/", "romap::render"},
      {"client/synth/", "romap::synth"},
      {"client/pictures/", "romap::pictures"},
      {"client/sdk/", "romap::client"},
      {"client/bench/", "romap::bench"},
      {"client/cli/", "romap::cli"},
  };
  for (const auto& [folder, name] : kNamespaces) {
    if (path.starts_with(folder)) return name;
  }
  return "";
}

TEST(HouseTest, EachFolderHasItsNamespace) {
  const std::regex opening(R"(^namespace (romap[\w:]*) \{)");
  for (const SourceFile& file : SourceFiles()) {
    const std::string expected = NamespaceOf(file.path);
    if (expected.empty()) continue;
    for (const std::string& line : file.lines) {
      std::smatch match;
      if (!std::regex_search(line, match, opening)) continue;
      const std::string found = match[1];
      // Highway compiles one namespace per instruction set inside the folder's own.
      EXPECT_TRUE(found == expected || found == expected + "::HWY_NAMESPACE" ||
                  found.starts_with(expected + "::internal"))
          << file.path << " opens " << found << ", expected " << expected;
    }
  }
}

// Two types of one name in one program are confusing even in different namespaces, and undefined behavior in the same.
TEST(HouseTest, TypeNamesAreUnique) {
  const std::regex type(R"(^(?:class|struct|enum class) (?:alignas\(\d+\) )?(\w+)(?: final)?(?: :[^:].*)? \{)");
  std::map<std::string, std::string> defined_in;
  for (const SourceFile& file : SourceFiles()) {
    const bool is_product = !file.path.starts_with("tests/");
    const bool is_header = file.path.ends_with(".h") || file.path.ends_with(".cuh");
    if (!is_product || !is_header) continue;
    for (const std::string& line : file.lines) {
      std::smatch match;
      if (!std::regex_search(line, match, type)) continue;
      const auto [entry, is_new] = defined_in.emplace(match[1], file.path);
      EXPECT_TRUE(is_new) << match[1] << " is defined in " << entry->second << " and in " << file.path;
    }
  }
  EXPECT_GT(defined_in.size(), 200u) << "the pattern no longer finds the types";
}

TEST(HouseTest, FilesStayReadable) {
  for (const SourceFile& file : SourceFiles()) EXPECT_LE(file.lines.size(), 500u) << file.path;
}

TEST(HouseTest, HeadersAreGuarded) {
  for (const SourceFile& file : SourceFiles()) {
    if (!file.path.ends_with(".h") || file.path.ends_with("-inl.h")) continue;
    const bool guarded = std::any_of(file.lines.begin(), file.lines.end(), [](const std::string& line) {
      // Files that Highway compiles once per instruction set guard by its toggle.
      return line.starts_with("#pragma once") || line.find("HWY_TARGET_TOGGLE") != std::string::npos;
    });
    EXPECT_TRUE(guarded) << file.path;
  }
}

}  // namespace
}  // namespace romap::house
