#include "server/store/blob_log.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "common/status.h"
#include "tests/support/subprocess.h"

namespace romap::store::blob_log_test {

class BlobLogTest : public ::testing::Test {
 protected:
  std::string Folder() const { return folder_ / "session"; }
  std::string Segment(const char* name = "000000.seg") const { return std::filesystem::path(Folder()) / name; }

  testing_support::TemporaryFolder folder_;
};

TEST_F(BlobLogTest, ReturnsWhatWasWritten) {
  BlobLog log(Folder(), 0, 0);
  const std::string image(100'000, 'x');
  const BlobRef first = log.Append(image), empty = log.Append(""), last = log.Append("mask");
  EXPECT_FALSE(BlobLog::Read(Folder(), first).ok()) << "not synchronized";
  ASSERT_TRUE(log.Sync().ok());
  EXPECT_EQ(BlobLog::Read(Folder(), first).value(), image);
  EXPECT_EQ(BlobLog::Read(Folder(), empty).value(), "");
  EXPECT_EQ(BlobLog::Read(Folder(), last).value(), "mask");
}

TEST_F(BlobLogTest, OverwritesWhatWasWrittenAfterTheEnd) {
  BlobRef kept;
  {
    BlobLog log(Folder(), 0, 0);
    kept = log.Append("kept");
    ASSERT_TRUE(log.Sync().ok());
    log.Append(std::string(1000, 'a'));  // synchronized, but not in the catalog before the crash
    ASSERT_TRUE(log.Sync().ok());
  }
  BlobLog log(Folder(), kept.segment, kept.EndOffset());
  const BlobRef added = log.Append("added");
  EXPECT_EQ(added.offset, kept.EndOffset());
  ASSERT_TRUE(log.Sync().ok());
  EXPECT_EQ(std::filesystem::file_size(Segment()), added.EndOffset());
  EXPECT_EQ(BlobLog::Read(Folder(), kept).value(), "kept");
  EXPECT_EQ(BlobLog::Read(Folder(), added).value(), "added");
}

TEST_F(BlobLogTest, DiscardedBlobsLeaveNoGap) {
  BlobLog log(Folder(), 0, 0);
  log.Append("discarded");
  log.Discard();
  EXPECT_FALSE(log.HasPending());
  const BlobRef blob = log.Append("kept");
  EXPECT_EQ(blob.offset, 0u);
  ASSERT_TRUE(log.Sync().ok());
  EXPECT_EQ(BlobLog::Read(Folder(), blob).value(), "kept");
}

TEST_F(BlobLogTest, DetectsFlippedBitsAndMissingBytes) {
  BlobLog log(Folder(), 0, 0);
  const BlobRef first = log.Append("first blob"), second = log.Append("second blob");
  ASSERT_TRUE(log.Sync().ok());
  {
    std::fstream file(Segment(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(first.EndOffset() - 1));
    file.put('B');
  }
  const absl::Status flipped = BlobLog::Read(Folder(), first).status();
  EXPECT_EQ(flipped.code(), absl::StatusCode::kDataLoss);
  EXPECT_NE(Message(flipped).find("000000.seg: the blob at byte 0 is damaged"), std::string::npos) << flipped;
  EXPECT_TRUE(BlobLog::Read(Folder(), second).ok()) << "other blobs are not affected";
  std::filesystem::resize_file(Segment(), second.EndOffset() - 1);
  EXPECT_EQ(BlobLog::Read(Folder(), second).status().code(), absl::StatusCode::kDataLoss);
  std::filesystem::remove(Segment());
  EXPECT_EQ(BlobLog::Read(Folder(), second).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(BlobLogTest, NumbersOfADamagedCatalogAreDataLoss) {
  BlobLog log(Folder(), 0, 0);
  BlobRef blob = log.Append("mask");
  ASSERT_TRUE(log.Sync().ok());
  constexpr uint64_t kMax = ~uint64_t{0};
  for (const auto& [offset, length] : {std::pair{uint64_t{0}, kMax}, {kMax, uint64_t{4}}, {kMax - 40, uint64_t{10}}}) {
    blob.offset = offset;
    blob.length = length;
    EXPECT_TRUE(absl::IsDataLoss(BlobLog::Read(Folder(), blob).status())) << offset << " " << length;
  }
}

TEST_F(BlobLogTest, StartsANewSegmentWhenOneIsFull) {
  BlobLog log(Folder(), 0, uint64_t{64} << 20);
  const BlobRef blob = log.Append("next");
  EXPECT_EQ(blob.segment, 1u);
  EXPECT_EQ(blob.offset, 0u);
  ASSERT_TRUE(log.Sync().ok());
  EXPECT_EQ(BlobLog::Read(Folder(), blob).value(), "next");
}

TEST_F(BlobLogTest, ReportsAFolderThatCannotBeCreated) {
  std::ofstream((folder_ / "file")).put('x');
  BlobLog log((folder_ / "file") + "/session", 0, 0);
  log.Append("blob");
  EXPECT_FALSE(log.Sync().ok());
}

}  // namespace romap::store::blob_log_test
