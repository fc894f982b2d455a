#include "server/access/token_store.h"

#include <fcntl.h>
#include <sodium.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "common/file_status.h"
#include "common/status.h"
#include "common/unix_time.h"

namespace romap::access {
namespace {

namespace fs = std::filesystem;

constexpr char kPrefix[] = "romap_";
constexpr size_t kIdBytes = 4;
constexpr size_t kSecretBytes = 32;
constexpr size_t kMaxNameLength = 64;
constexpr int kVersion = 1;
constexpr std::array<std::pair<Role, const char*>, 3> kRoles{
    {{Role::kViewer, "viewer"}, {Role::kOwner, "owner"}, {Role::kAdmin, "admin"}}};

std::string Hex(const std::vector<unsigned char>& bytes) {
  std::string hex(2 * bytes.size() + 1, '\0');
  sodium_bin2hex(hex.data(), hex.size(), bytes.data(), bytes.size());
  hex.pop_back();
  return hex;
}

std::vector<unsigned char> RandomBytes(size_t count) {
  std::vector<unsigned char> bytes(count);
  randombytes_buf(bytes.data(), bytes.size());
  return bytes;
}

// Of a secret, as hex. The key is only salt: the secret has 256 random bits, so that nobody can guess it.
std::string HashOf(std::string_view secret, const std::string& key) {
  std::vector<unsigned char> hash(crypto_generichash_BYTES);
  crypto_generichash(hash.data(), hash.size(), reinterpret_cast<const unsigned char*>(secret.data()), secret.size(),
                     reinterpret_cast<const unsigned char*>(key.data()),
                     std::min<size_t>(key.size(), crypto_generichash_KEYBYTES_MAX));
  return Hex(hash);
}

absl::Status CheckName(const char* what, const std::string& text) {
  const auto is_allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
           c == '-';
  };
  if (!text.empty() && text.size() <= kMaxNameLength && std::all_of(text.begin(), text.end(), is_allowed)) {
    return absl::OkStatus();
  }
  return InvalidArgument("{}: must have 1 to {} letters, digits, '.', '_' or '-'", what, kMaxNameLength);
}

// Other processes that change the file wait meanwhile.
class FileLock {
 public:
  explicit FileLock(const std::string& path) : fd_(open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600)) {
    if (fd_ >= 0) flock(fd_, LOCK_EX);
  }
  ~FileLock() {
    if (fd_ >= 0) close(fd_);
  }
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 private:
  int fd_;
};

}  // namespace

const char* ToString(Role role) {
  return std::find_if(kRoles.begin(), kRoles.end(), [&](const auto& entry) { return entry.first == role; })->second;
}

absl::StatusOr<Role> ParseRole(std::string_view text) {
  for (const auto& [role, name] : kRoles) {
    if (text == name) return role;
  }
  return InvalidArgument("role: must be viewer, owner or admin, is '{}'", text);
}

bool TokenStore::Exists() const {
  std::error_code error;
  return fs::exists(path_, error) || error;  // a file that cannot be examined must not open the server
}

std::optional<TokenStore::FileVersion> TokenStore::Version() const {
  struct stat status {};
  if (stat(path_.c_str(), &status) != 0) return std::nullopt;
  return FileVersion{.inode = status.st_ino,
                     .changed_ns = int64_t{1'000'000'000} * status.st_mtim.tv_sec + status.st_mtim.tv_nsec};
}

absl::StatusOr<TokenStore::File> TokenStore::Read() const {
  std::ifstream stream(path_, std::ios::binary);
  if (!stream) return FileError(path_, "read the tokens");
  const nlohmann::json json = nlohmann::json::parse(stream, nullptr, /*allow_exceptions=*/false);
  try {
    if (json.at("version") != kVersion) return InvalidArgument("{}: has another version than {}", path_, kVersion);
    File file;
    file.key = json.at("key");
    for (const nlohmann::json& entry : json.at("tokens")) {
      TokenRecord& token = file.tokens.emplace_back();
      token.id = entry.at("id");
      token.name = entry.at("name");
      token.tenant = entry.at("tenant");
      ROMAP_ASSIGN_OR_RETURN(token.role, ParseRole(entry.at("role").get<std::string>()));
      token.created_unix_s = entry.at("created_unix_s");
      token.hash = entry.at("hash");
    }
    return file;
  } catch (const nlohmann::json::exception&) {
    return InvalidArgument("{}: is not a file of tokens; create one with: romap-server token create", path_);
  }
}

absl::StatusOr<TokenStore::File> TokenStore::ReadOrCreate() const {
  if (Exists()) return Read();
  return File{.key = Hex(RandomBytes(crypto_generichash_KEYBYTES_MAX / 2)), .tokens = {}};
}

absl::Status TokenStore::Write(const File& file) const {
  nlohmann::json json{{"version", kVersion}, {"key", file.key}, {"tokens", nlohmann::json::array()}};
  for (const TokenRecord& token : file.tokens) {
    json["tokens"].push_back({{"id", token.id},
                              {"name", token.name},
                              {"tenant", token.tenant},
                              {"role", ToString(token.role)},
                              {"created_unix_s", token.created_unix_s},
                              {"hash", token.hash}});
  }
  const std::string text = json.dump(2) + "\n";
  const std::string temporary = path_ + ".new";
  const int fd = open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (fd < 0) return FileError(temporary, "write the tokens");
  const bool written = write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && fdatasync(fd) == 0;
  const absl::Status status = written ? absl::OkStatus() : FileError(temporary, "write the tokens");
  close(fd);
  ROMAP_RETURN_IF_ERROR(status);
  if (rename(temporary.c_str(), path_.c_str()) != 0) return FileError(path_, "replace the tokens");
  return absl::OkStatus();
}

absl::StatusOr<std::string> TokenStore::Create(const std::string& name, const std::string& tenant, Role role) {
  ROMAP_RETURN_IF_ERROR(CheckName("name", name));
  ROMAP_RETURN_IF_ERROR(CheckName("tenant", tenant));
  if (sodium_init() < 0) return Internal("libsodium cannot be initialized");
  const FileLock lock(path_ + ".lock");
  ROMAP_ASSIGN_OR_RETURN(File file, ReadOrCreate());
  const std::string secret = Hex(RandomBytes(kSecretBytes));
  std::string id;
  do {
    id = Hex(RandomBytes(kIdBytes));
  } while (std::ranges::any_of(file.tokens, [&](const TokenRecord& token) { return token.id == id; }));
  file.tokens.push_back({.id = id,
                         .name = name,
                         .tenant = tenant,
                         .role = role,
                         .created_unix_s = UnixNow_ns() / 1'000'000'000,
                         .hash = HashOf(secret, file.key)});
  ROMAP_RETURN_IF_ERROR(Write(file));
  return kPrefix + id + "_" + secret;
}

absl::StatusOr<std::vector<TokenRecord>> TokenStore::List() const {
  if (!Exists()) return std::vector<TokenRecord>{};
  ROMAP_ASSIGN_OR_RETURN(File file, Read());
  return std::move(file.tokens);
}

absl::Status TokenStore::Revoke(const std::string& id) {
  if (!Exists()) return NotFound("token '{}' does not exist", id);
  const FileLock lock(path_ + ".lock");
  ROMAP_ASSIGN_OR_RETURN(File file, Read());
  if (std::erase_if(file.tokens, [&](const TokenRecord& token) { return token.id == id; }) == 0) {
    return NotFound("token '{}' does not exist", id);
  }
  return Write(file);
}

std::optional<Identity> TokenStore::Find(std::string_view token) const {
  std::lock_guard lock(mutex_);
  const std::optional<FileVersion> version = Version();
  if (!version) return std::nullopt;
  if (cached_version_ != version) {
    absl::StatusOr<File> file = Read();
    if (!file.ok()) return std::nullopt;
    cached_ = *std::move(file);
    cached_version_ = version;
  }
  return FindIn(cached_, token);
}

std::optional<Identity> TokenStore::FindIn(const File& file, std::string_view token) const {
  if (!token.starts_with(kPrefix)) return std::nullopt;
  token.remove_prefix(std::string_view(kPrefix).size());
  const size_t separator = token.find('_');
  if (separator == std::string_view::npos) return std::nullopt;
  const std::string_view id = token.substr(0, separator);
  const auto found = std::ranges::find_if(file.tokens, [&](const TokenRecord& record) { return record.id == id; });
  if (found == file.tokens.end()) return std::nullopt;
  const std::string hash = HashOf(token.substr(separator + 1), file.key);
  if (hash.size() != found->hash.size() || sodium_memcmp(hash.data(), found->hash.data(), hash.size()) != 0) {
    return std::nullopt;
  }
  return Identity{.token_id = found->id, .tenant = found->tenant, .role = found->role};
}

}  // namespace romap::access
