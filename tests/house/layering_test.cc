// Checks the rules of the source tree: allowed includes, namespaces, unique type names, file lengths and include
// guards.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <string>
#include <vector>

namespace romap::house::layering_test {

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

// Allowed prefixes of included paths. The longest prefix of a path applies to it.
const std::map<std::string, std::vector<std::string>> kMayInclude = {
    {"common/", {"common/"}},
    {"common/wire/", {"common/", "romap/v1/"}},
    {"common/build_info/", {"common/", "generated/"}},
    {"server/slam/", {"server/slam/", "common/"}},
    {"server/slam/features/", {"server/slam/features/", "server/slam/slam_config.h", "common/"}},
    {"server/slam/geometry/", {"server/slam/geometry/", "common/"}},
    {"server/slam/optimize/", {"server/slam/optimize/", "common/"}},
    {"server/slam/places/", {"server/slam/places/", "server/slam/features/", "server/slam/slam_config.h", "common/"}},
    {"server/hull/", {"server/hull/", "common/"}},
    {"server/masks/", {"server/masks/", "common/"}},
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
    {"server/texture/", {"server/texture/", "common/"}},
    {"server/store/", {"server/store/", "common/", "romap/v1/"}},
    {"server/session/", {"server/", "common/"}},
    {"server/access/", {"server/access/", "common/"}},
    {"server/transport/", {"server/transport/", "server/access/", "common/", "romap/v1/"}},
    {"server/process/", {"server/process/", "common/"}},
    {"server/http/",
     {"server/http/", "server/access/", "server/transport/tls_files.h", "server/transport/listener.h",
      "server/transport/transport_config.h", "common/", "romap/v1/"}},
    {"server/main.cc", {"server/", "common/"}},
    {"client/files/", {"client/files/", "common/"}},
    {"client/importers/", {"client/importers/", "client/files/", "common/"}},
    {"client/exports/", {"client/exports/", "client/files/", "common/"}},
    {"client/eval/", {"client/eval/", "client/files/", "common/"}},
    {"client/render/", {"client/render/", "common/"}},
    {"client/synth/", {"client/synth/", "client/render/", "client/files/", "common/"}},
    {"client/doctor/", {"client/doctor/", "client/files/", "common/"}},
    {"client/pictures/", {"client/pictures/", "client/render/", "common/"}},
    {"client/sdk/", {"client/sdk/", "common/", "romap/v1/"}},
    {"client/python/", {"common/"}},
    {"client/examples/", {}},  // built against the installed headers
    {"client/bench/",
     {"client/bench/", "client/eval/", "client/files/", "server/session/", "server/nerf/", "server/mesh/", "common/"}},
    {"client/cli/", {"client/", "server/masks/", "server/session/", "common/"}},
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
  static const std::vector<std::string> kNone;
  EXPECT_NE(best, nullptr) << path << ": kMayInclude has no entry for this folder";
  return best == nullptr ? kNone : *best;
}

TEST(SourceTreeTest, FoldersIncludeOnlyAllowedFolders) {
  const std::regex include(R"(^\s*#include\s+"([^"]+)\")");
  for (const SourceFile& file : SourceFiles()) {
    const std::vector<std::string>& allowed = Allowed(file.path);
    for (const std::string& line : file.lines) {
      std::smatch match;
      if (!std::regex_search(line, match, include)) continue;
      const std::string target = match[1];
      if (target.find('/') == std::string::npos) continue;  // a file of the same folder
      if (target.starts_with("hwy/") || target.starts_with("google/")) continue;
      // Only the session includes the stages; transport and the command line include only the session.
      EXPECT_TRUE(
          std::any_of(allowed.begin(), allowed.end(), [&](const std::string& a) { return target.starts_with(a); }))
          << file.path << " must not include " << target;
    }
  }
}

// The headers of client/sdk are installed; users of the library need neither gRPC nor protobuf.
TEST(SourceTreeTest, PublicHeadersOfTheSdkIncludeNoGrpc) {
  const std::regex include(R"(^\s*#include\s+[<"](grpc|google/|romap/v1/|common/wire/|client/sdk/internal/))");
  for (const SourceFile& file : SourceFiles()) {
    const std::filesystem::path path = file.path;
    if (path.parent_path() != "client/sdk" || path.extension() != ".h") continue;
    for (const std::string& line : file.lines) EXPECT_FALSE(std::regex_search(line, include)) << path << ": " << line;
  }
}

// The namespace of the files in a folder; empty = not checked.
std::string NamespaceOf(const std::string& path) {
  static const std::vector<std::pair<std::string, std::string>> kNamespaces = {
      {"common/wire/", "romap::wire"},
      {"common/", "romap"},
      {"server/slam/", "romap::slam"},
      {"server/objects/", "romap::objects"},
      {"server/nerf/cuda/", "romap::nerf::cuda"},
      {"server/nerf/", "romap::nerf"},
      {"server/mesh/", "romap::mesh"},
      {"server/texture/", "romap::texture"},
      {"server/hull/", "romap::hull"},
      {"server/session/", "romap::session"},
      {"server/access/", "romap::access"},
      {"server/transport/", "romap::transport"},
      {"server/process/", "romap::process"},
      {"server/http/", "romap::http"},
      {"client/files/", "romap::files"},
      {"client/importers/", "romap::importers"},
      {"client/eval/", "romap::eval"},
      {"client/render/", "romap::render"},
      {"client/synth/", "romap::synth"},
      {"client/pictures/", "romap::pictures"},
      {"client/sdk/", "romap::client"},
      {"client/bench/", "romap::bench"},
      {"client/exports/", "romap::exports"},
      {"client/cli/", "romap::cli"},
  };
  for (const auto& [folder, name] : kNamespaces) {
    if (path.starts_with(folder)) return name;
  }
  return "";
}

TEST(SourceTreeTest, FilesUseTheNamespaceOfTheirFolder) {
  const std::regex opening(R"(^namespace (romap[\w:]*) \{)");
  for (const SourceFile& file : SourceFiles()) {
    const std::string expected = NamespaceOf(file.path);
    if (expected.empty()) continue;
    for (const std::string& line : file.lines) {
      std::smatch match;
      if (!std::regex_search(line, match, opening)) continue;
      const std::string found = match[1];
      // Highway opens one nested namespace per instruction set.
      EXPECT_TRUE(found == expected || found == expected + "::HWY_NAMESPACE" ||
                  found.starts_with(expected + "::internal"))
          << file.path << " opens " << found << ", expected " << expected;
    }
  }
}

// Types with the same name are confusing in different namespaces, and undefined behavior in the same namespace.
TEST(SourceTreeTest, TypeNamesAreUnique) {
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

TEST(SourceTreeTest, FilesAreShort) {
  for (const SourceFile& file : SourceFiles()) EXPECT_LE(file.lines.size(), 500u) << file.path;
}

TEST(SourceTreeTest, HeadersAreGuarded) {
  for (const SourceFile& file : SourceFiles()) {
    if (!file.path.ends_with(".h") || file.path.ends_with("-inl.h")) continue;
    const bool guarded = std::any_of(file.lines.begin(), file.lines.end(), [](const std::string& line) {
      // Files that Highway compiles once per instruction set use its toggle as include guard.
      return line.starts_with("#pragma once") || line.find("HWY_TARGET_TOGGLE") != std::string::npos;
    });
    EXPECT_TRUE(guarded) << file.path;
  }
}

}  // namespace romap::house::layering_test
