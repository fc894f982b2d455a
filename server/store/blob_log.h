#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <set>
#include <string>
#include <string_view>

namespace romap::store {

// Where a blob is, and what it must contain.
struct BlobRef {
  uint32_t segment = 0;
  uint64_t offset = 0;  // of its header in the segment, bytes
  uint64_t length = 0;  // without the header, bytes
  std::string hash;     // XXH3 of the content, 16 bytes in canonical (big-endian) order

  uint64_t EndOffset() const;
  bool operator==(const BlobRef&) const = default;
};

// The images, masks, meshes and trajectories of one session, in append-only files of about 64 MiB (NNNNNN.seg). Layout
// of a blob: "RBLB", 4 zero bytes, uint64 length (little-endian), 16 bytes hash, content. What is not synchronized is
// not part of the log: the catalog, which is written later, says where the log ends. Not thread-safe, except Read().
class BlobLog {
 public:
  // `segment`, `end_offset`: the end of the newest blob in the catalog; 0, 0 for an empty log. Bytes behind it were
  // written just before a crash and will be overwritten.
  BlobLog(std::string folder, uint32_t segment, uint64_t end_offset);
  ~BlobLog();
  BlobLog(const BlobLog&) = delete;
  BlobLog& operator=(const BlobLog&) = delete;

  // Keeps the blob in memory until Sync().
  BlobRef Append(std::string_view content);
  // Writes the appended blobs and waits until the disk has them. Errors as FileError(); then call Discard().
  absl::Status Sync();
  // Forgets the blobs that were appended since the last successful Sync().
  void Discard();
  bool HasPending() const { return !pending_.empty(); }
  size_t pending_bytes() const { return pending_.size(); }
  uint32_t segment() const { return segment_; }
  // Of the segments that exist.
  static std::set<uint32_t> Segments(const std::string& folder);
  // Those that cannot be removed are left.
  static void RemoveSegments(const std::string& folder, const std::set<uint32_t>& segments);

  // NOT_FOUND etc. as FileError(). DATA_LOSS: the content is not what was written.
  static absl::StatusOr<std::string> Read(const std::string& folder, const BlobRef& blob);

 private:
  absl::Status OpenSegment();
  void CloseSegment();

  const std::string folder_;
  uint32_t segment_;
  uint64_t end_;  // of the synchronized blobs in segment_
  std::string pending_;
  int fd_ = -1;  // of segment_; -1: not open
};

}  // namespace romap::store
