#include "server/store/session_file.h"

#include <string_view>
#include <utility>

#include "common/status.h"
#include "server/store/content_hash.h"

namespace romap::store {
namespace {

constexpr std::string_view kFileMagic = "ROMAPSES";
constexpr uint32_t kFileVersion = 1;
constexpr size_t kFileHeaderBytes = 8 + 4;
constexpr size_t kRecordHeaderBytes = 1 + 8 + kHashBytes;
constexpr uint64_t kMaxRecordBytes = uint64_t{256} << 20;

std::string LittleEndian(uint64_t number, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += static_cast<char>(number >> (8 * i));
  return text;
}

uint64_t FromLittleEndian(std::string_view bytes) {
  uint64_t number = 0;
  for (size_t i = 0; i < bytes.size(); ++i) number |= uint64_t{static_cast<unsigned char>(bytes[i])} << (8 * i);
  return number;
}

}  // namespace

std::string SessionFileHeader() { return std::string(kFileMagic) + LittleEndian(kFileVersion, 4); }

std::string SessionFileRecord(FileRecord kind, const std::string& content) {
  return static_cast<char>(kind) + LittleEndian(content.size(), 8) + HashOf(content) + content;
}

absl::Status SessionFileReader::Add(const std::string& bytes) {
  waiting_ += bytes;
  if (!has_header_) {
    const std::string_view begin = std::string_view(waiting_).substr(0, kFileMagic.size());
    if (begin != kFileMagic.substr(0, begin.size())) {
      return InvalidArgument("not a session file: must start with {}", kFileMagic);
    }
    if (waiting_.size() < kFileHeaderBytes) return absl::OkStatus();
    const uint64_t version = FromLittleEndian(std::string_view(waiting_).substr(kFileMagic.size(), 4));
    if (version != kFileVersion) {
      return InvalidArgument("the session file has version {}; this release reads version {}", version, kFileVersion);
    }
    waiting_.erase(0, kFileHeaderBytes);
    has_header_ = true;
  }
  return ReadRecords();
}

absl::Status SessionFileReader::ReadRecords() {
  size_t begin = 0;
  while (waiting_.size() - begin >= kRecordHeaderBytes) {
    const std::string_view rest = std::string_view(waiting_).substr(begin);
    const uint64_t length = FromLittleEndian(rest.substr(1, 8));
    if (length > kMaxRecordBytes) return InvalidArgument("the session file is damaged: a record of {} bytes", length);
    if (rest.size() < kRecordHeaderBytes + length) break;
    std::string content(rest.substr(kRecordHeaderBytes, length));
    if (has_end_) return InvalidArgument("the session file is damaged: it continues behind its end");
    if (HashOf(content) != rest.substr(9, kHashBytes)) {
      return InvalidArgument("the session file is damaged: the hash of a record of {} bytes is wrong", length);
    }
    const auto kind = static_cast<FileRecord>(rest[0]);
    has_end_ = kind == FileRecord::kEnd;
    begin += kRecordHeaderBytes + length;
    ROMAP_RETURN_IF_ERROR(sink_(kind, std::move(content)));
  }
  waiting_.erase(0, begin);
  return absl::OkStatus();
}

absl::Status SessionFileReader::End() const {
  if (has_end_ && waiting_.empty()) return absl::OkStatus();
  return InvalidArgument("the session file is cut off");
}

}  // namespace romap::store
