#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/access/identity.h"

namespace romap::access {

// "viewer", "owner" or "admin".
const char* ToString(Role role);
// INVALID_ARGUMENT: another text.
absl::StatusOr<Role> ParseRole(std::string_view text);

// A token as it is stored. Its secret is not: only a keyed hash of it (BLAKE2b, libsodium), so that the file does not
// let anybody in.
struct TokenRecord {
  std::string id;    // public, 8 hex digits
  std::string name;  // for people
  std::string tenant;
  Role role = Role::kViewer;
  int64_t created_unix_s = 0;
  std::string hash;  // hex
};

// The tokens of a server, in a JSON file that only its user may read. Several processes may use the file: a change is
// written to another file, which then takes its place. Thread-safe.
class TokenStore {
 public:
  explicit TokenStore(std::string path) : path_(std::move(path)) {}

  // Whether the file exists: then every call needs a token, even if the file has none.
  bool Exists() const;
  // Adds a token and returns its text, which is not stored anywhere. INVALID_ARGUMENT: name or tenant is empty, long,
  // or has other characters than letters, digits, '.', '_' and '-'.
  absl::StatusOr<std::string> Create(const std::string& name, const std::string& tenant, Role role);
  absl::StatusOr<std::vector<TokenRecord>> List() const;
  // NOT_FOUND: there is no token with this id.
  absl::Status Revoke(const std::string& id);

  // The caller with this token; nullopt if it is not valid. Reads the file again when it has changed. While the file
  // cannot be read, no token is valid.
  std::optional<Identity> Find(std::string_view token) const;

 private:
  struct File {
    std::string key;  // of the hashes, hex
    std::vector<TokenRecord> tokens;
  };

  // Differs after every change: a new file takes the place of the old one.
  struct FileVersion {
    uint64_t inode = 0;
    int64_t changed_ns = 0;

    bool operator==(const FileVersion&) const = default;
  };

  std::optional<FileVersion> Version() const;
  absl::StatusOr<File> Read() const;
  absl::StatusOr<File> ReadOrCreate() const;
  absl::Status Write(const File& file) const;
  std::optional<Identity> FindIn(const File& file, std::string_view token) const;

  const std::string path_;
  mutable std::mutex mutex_;
  // As of the last Find().
  mutable File cached_;
  mutable std::optional<FileVersion> cached_version_;
};

}  // namespace romap::access
