#include "server/store/blob_log.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "common/file_status.h"
#include "common/status.h"
#include "server/store/content_hash.h"

namespace romap::store {
namespace {

constexpr std::string_view kMagic{"RBLB\0\0\0\0", 8};
constexpr size_t kHeaderBytes = 8 + 8 + kHashBytes;
constexpr uint64_t kSegmentBytes = uint64_t{64} << 20;

std::string HeaderOf(uint64_t length, const std::string& hash) {
  std::string header(kMagic);
  for (int i = 0; i < 8; ++i) header += static_cast<char>(length >> (8 * i));
  return header + hash;
}

std::string SegmentPath(const std::string& folder, uint32_t segment) {
  return std::filesystem::path(folder) / fmt::format("{:06}.seg", segment);
}

absl::Status SyncFolder(const std::string& folder) {
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return FileError(folder, "open the folder");
  const int result = fsync(fd);
  const int error = errno;
  close(fd);
  return result == 0 ? absl::OkStatus() : FileError(folder, "synchronize the folder", error);
}

class FileDescriptor {
 public:
  explicit FileDescriptor(int fd) : fd_(fd) {}
  ~FileDescriptor() {
    if (fd_ >= 0) close(fd_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  int get() const { return fd_; }

 private:
  const int fd_;
};

}  // namespace

uint64_t BlobRef::EndOffset() const { return offset + kHeaderBytes + length; }

BlobLog::BlobLog(std::string folder, uint32_t segment, uint64_t end_offset)
    : folder_(std::move(folder)), segment_(segment), end_(end_offset) {}

BlobLog::~BlobLog() { CloseSegment(); }

BlobRef BlobLog::Append(std::string_view content) {
  if (pending_.empty() && end_ >= kSegmentBytes) {
    CloseSegment();
    ++segment_;
    end_ = 0;
  }
  BlobRef blob{
      .segment = segment_, .offset = end_ + pending_.size(), .length = content.size(), .hash = HashOf(content)};
  pending_ += HeaderOf(blob.length, blob.hash);
  pending_ += content;
  return blob;
}

absl::Status BlobLog::OpenSegment() {
  if (fd_ >= 0) return absl::OkStatus();
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error) return FileError(folder_, "create the folder of the session", error);
  const std::string path = SegmentPath(folder_, segment_);
  fd_ = open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  if (fd_ < 0) return FileError(path, "open the file");
  // Bytes behind the end were never acknowledged.
  struct stat info {};
  if (fstat(fd_, &info) == 0 && static_cast<uint64_t>(info.st_size) > end_ &&
      ftruncate(fd_, static_cast<off_t>(end_)) != 0) {
    const absl::Status status = FileError(path, "truncate the file");
    CloseSegment();
    return status;
  }
  ROMAP_RETURN_IF_ERROR(SyncFolder(folder_));
  return SyncFolder(std::filesystem::path(folder_).parent_path());
}

void BlobLog::CloseSegment() {
  if (fd_ >= 0) close(fd_);
  fd_ = -1;
}

absl::Status BlobLog::Sync() {
  if (pending_.empty()) return absl::OkStatus();
  ROMAP_RETURN_IF_ERROR(OpenSegment());
  const auto fail = [&](const char* action) {
    const absl::Status status = FileError(SegmentPath(folder_, segment_), action);
    CloseSegment();  // after an error, a second fsync() of the same descriptor could succeed without the data
    return status;
  };
  size_t written = 0;
  while (written < pending_.size()) {
    const ssize_t bytes =
        pwrite(fd_, pending_.data() + written, pending_.size() - written, static_cast<off_t>(end_ + written));
    if (bytes < 0 && errno == EINTR) continue;
    if (bytes <= 0) return fail("write to the file");
    written += static_cast<size_t>(bytes);
  }
  if (fdatasync(fd_) != 0) return fail("synchronize the file");
  end_ += pending_.size();
  pending_.clear();
  return absl::OkStatus();
}

void BlobLog::Discard() { pending_.clear(); }

std::set<uint32_t> BlobLog::Segments(const std::string& folder) {
  std::set<uint32_t> segments;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    uint32_t segment = 0;
    const std::string name = entry.path().filename();
    std::from_chars(name.data(), name.data() + name.size(), segment);
    if (entry.path() == SegmentPath(folder, segment)) segments.insert(segment);
  }
  return segments;
}

void BlobLog::RemoveSegments(const std::string& folder, const std::set<uint32_t>& segments) {
  std::error_code error;
  for (const uint32_t segment : segments) std::filesystem::remove(SegmentPath(folder, segment), error);
}

absl::StatusOr<std::string> BlobLog::Read(const std::string& folder, const BlobRef& blob) {
  const std::string path = SegmentPath(folder, blob.segment);
  const FileDescriptor file(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0) return FileError(path, "open the file");
  struct stat info {};
  if (fstat(file.get(), &info) != 0) return FileError(path, "read the file");
  const auto lost = [&](const char* what) {
    return absl::DataLossError(fmt::format("{}: the blob at byte {} {}", path, blob.offset, what));
  };
  // Not by the sum, which overflows for the numbers of a damaged catalog.
  const auto file_bytes = static_cast<uint64_t>(info.st_size);
  if (blob.length > file_bytes || blob.offset > file_bytes - blob.length ||
      kHeaderBytes > file_bytes - blob.length - blob.offset) {
    return lost("is cut off");
  }
  std::string content(blob.length, '\0');
  size_t got = 0;
  while (got < content.size()) {
    const ssize_t bytes = pread(file.get(), content.data() + got, content.size() - got,
                                static_cast<off_t>(blob.offset + kHeaderBytes + got));
    if (bytes < 0 && errno == EINTR) continue;
    if (bytes <= 0) return FileError(path, "read the file");
    got += static_cast<size_t>(bytes);
  }
  if (HashOf(content) != blob.hash) return lost("is damaged: its hash differs from that in the catalog");
  return content;
}

}  // namespace romap::store
