#include "common/wire/recording.h"

#include <array>
#include <cerrno>
#include <filesystem>
#include <optional>
#include <utility>

#include "common/file_status.h"
#include "common/status.h"
#include "common/wire/frame.h"
#include "common/wire/sessions.h"
#include "romap/v1/mapping.pb.h"

namespace romap::wire {
namespace {

constexpr char kMagic[] = "ROMAPREC";
constexpr size_t kMagicBytes = sizeof(kMagic) - 1;
constexpr uint32_t kFramesOnly = 1, kVersion = 2;
constexpr size_t kNumberBytes = 4;

std::string NumberBytes(uint32_t number) {
  std::string bytes(kNumberBytes, '\0');
  for (size_t i = 0; i < kNumberBytes; ++i) bytes[i] = static_cast<char>(number >> (8 * i));
  return bytes;
}

std::optional<uint32_t> ReadNumber(std::ifstream& file) {
  std::array<char, kNumberBytes> bytes;
  if (!file.read(bytes.data(), bytes.size())) return std::nullopt;
  uint32_t number = 0;
  for (size_t i = 0; i < kNumberBytes; ++i) {
    number |= static_cast<uint32_t>(static_cast<unsigned char>(bytes[i])) << (8 * i);
  }
  return number;
}

std::optional<std::string> ReadBytes(std::ifstream& file, uint32_t length) {
  std::string bytes(length, '\0');
  if (!file.read(bytes.data(), length)) return std::nullopt;
  return bytes;
}

std::string Record(const google::protobuf::MessageLite& message) {
  const std::string bytes = message.SerializeAsString();
  return NumberBytes(static_cast<uint32_t>(bytes.size())) + bytes;
}

v1::MapRequest ToRequest(SessionInput input) {
  v1::MapRequest request;
  if (auto* masks = std::get_if<MasksInput>(&input)) {
    *request.mutable_late_masks() = ToProto(std::move(*masks));
  } else {
    *request.mutable_frame() = ToProto(std::get<FrameInput>(std::move(input)));
  }
  return request;
}

// nullopt: the bytes are not a record of that version.
std::optional<v1::MapRequest> ParseRequest(const std::string& bytes, uint32_t version) {
  v1::MapRequest request;
  const bool parsed =
      version == kFramesOnly ? request.mutable_frame()->ParseFromString(bytes) : request.ParseFromString(bytes);
  if (!parsed || !(request.has_frame() || request.has_late_masks())) return std::nullopt;
  return request;
}

absl::StatusOr<SessionInput> FromRequest(v1::MapRequest request) {
  if (request.has_late_masks()) return FromProto(std::move(*request.mutable_late_masks()));
  return FromProto(std::move(*request.mutable_frame()));
}

}  // namespace

absl::StatusOr<std::unique_ptr<RecordingWriter>> RecordingWriter::Create(const std::string& path,
                                                                         const SessionOptions& options) {
  errno = 0;
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  if (!file) return FileError(path, "create the recording");
  std::unique_ptr<RecordingWriter> writer(new RecordingWriter(path, std::move(file)));
  ROMAP_RETURN_IF_ERROR(writer->Write(kMagic + NumberBytes(kVersion) + Record(ToProto(options))));
  return writer;
}

absl::Status RecordingWriter::Append(SessionInput input) { return Write(Record(ToRequest(std::move(input)))); }

absl::Status RecordingWriter::Write(const std::string& bytes) {
  errno = 0;
  file_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file_.flush();
  if (file_) return absl::OkStatus();
  return FileError(path_, "write to the recording");
}

absl::StatusOr<Recording> Recording::Open(const std::string& path) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file) return FileError(path, "open the recording");
  std::error_code error;
  const uint64_t file_bytes = std::filesystem::file_size(path, error);  // fails for a folder, which can be opened
  if (error) return FileError(path, "read the recording", error);
  Recording recording;
  recording.path_ = path;
  ROMAP_RETURN_IF_ERROR(recording.ReadHeader(file));
  ROMAP_RETURN_IF_ERROR(recording.FindRecords(file, file_bytes));
  return recording;
}

absl::Status Recording::ReadHeader(std::ifstream& file) {
  if (ReadBytes(file, kMagicBytes) != kMagic) {
    return InvalidArgument("{}: not a recording: must start with {}", path_, kMagic);
  }
  const std::optional<uint32_t> version = ReadNumber(file);
  if (!version) return InvalidArgument("{}: recording is truncated within its header", path_);
  if (*version < kFramesOnly || *version > kVersion) {
    return InvalidArgument("{}: recording version must be {} to {}, is {}", path_, kFramesOnly, kVersion, *version);
  }
  version_ = *version;
  const std::optional<uint32_t> length = ReadNumber(file);
  const std::optional<std::string> bytes = length && *length < (1U << 20) ? ReadBytes(file, *length) : std::nullopt;
  v1::CreateSessionRequest request;
  if (!bytes || !request.ParseFromString(*bytes)) {
    return InvalidArgument("{}: first record must be a CreateSessionRequest; it is damaged or truncated", path_);
  }
  auto options = FromProto(request);
  if (!options.ok()) return InvalidArgument("{}: session options: {}", path_, Message(options.status()));
  options_ = *std::move(options);
  return absl::OkStatus();
}

absl::Status Recording::FindRecords(std::ifstream& file, uint64_t file_bytes) {
  uint64_t offset = static_cast<uint64_t>(file.tellg());
  while (offset < file_bytes) {
    const std::optional<uint32_t> length = ReadNumber(file);
    const uint64_t begin = offset + kNumberBytes;
    if (!length || begin + *length > file_bytes) {
      lost_bytes_ = file_bytes - offset;
      break;
    }
    const std::optional<std::string> bytes = ReadBytes(file, *length);
    const std::optional<v1::MapRequest> request = bytes ? ParseRequest(*bytes, version_) : std::nullopt;
    if (!request) {
      return InvalidArgument("{}: record {} at byte {} must be a frame or masks; it is damaged", path_,
                             positions_.size() + 1, begin);
    }
    if (request->has_frame()) ++frames_;
    positions_.push_back({begin, *length});
    offset = begin + *length;
  }
  return absl::OkStatus();
}

absl::StatusOr<SessionInput> Recording::Load(size_t index) const {
  if (index >= size()) return InvalidArgument("{}: record index must be below {}, is {}", path_, size(), index);
  const Position& position = positions_[index];
  errno = 0;
  std::ifstream file(path_, std::ios::binary);
  if (!file) return FileError(path_, "open the recording");
  file.seekg(static_cast<std::streamoff>(position.offset));
  const std::optional<std::string> bytes = ReadBytes(file, position.length);
  std::optional<v1::MapRequest> request = bytes ? ParseRequest(*bytes, version_) : std::nullopt;
  if (!request) {
    return InvalidArgument("{}: record {} is damaged; the file was changed after it was opened", path_, index + 1);
  }
  auto input = FromRequest(*std::move(request));
  if (!input.ok()) return InvalidArgument("{}: record {}: {}", path_, index + 1, Message(input.status()));
  return input;
}

}  // namespace romap::wire
