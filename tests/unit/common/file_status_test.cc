#include "common/file_status.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "common/status.h"

namespace romap::file_status_test {

TEST(FileErrorTest, NamesPathActionAndReason) {
  const absl::Status status = FileError("/data/map.ply", "open for reading", ENOENT);
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(Message(status), "/data/map.ply: cannot open for reading: No such file or directory");
}

TEST(FileErrorTest, DerivesTheCodeFromErrno) {
  EXPECT_EQ(FileError("f", "write", EACCES).code(), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(FileError("f", "write", EISDIR).code(), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(FileError("f", "write", ENOSPC).code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(FileError("f", "write", EIO).code(), absl::StatusCode::kResourceExhausted);
}

TEST(FileErrorTest, UsesErrnoOfAFailedStream) {
  std::ifstream file("/nonexistent/file");
  EXPECT_EQ(FileError("/nonexistent/file", "open for reading").code(), absl::StatusCode::kNotFound);
}

TEST(FileErrorTest, AcceptsErrorCodesOfFilesystemFunctions) {
  std::error_code error;
  EXPECT_EQ(std::filesystem::file_size("/nonexistent/file", error), static_cast<uintmax_t>(-1));
  const absl::Status status = FileError("/nonexistent/file", "read the size", error);
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(Message(status), "/nonexistent/file: cannot read the size: No such file or directory");
}

TEST(FileErrorTest, ReportsAnUnknownReason) {
  EXPECT_EQ(Message(FileError("f", "write", 0)), "f: cannot write: unknown reason");
}

}  // namespace romap::file_status_test
