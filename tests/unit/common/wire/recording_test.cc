#include "common/wire/recording.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "common/status.h"
#include "common/wire/frame.h"
#include "tests/support/subprocess.h"

namespace romap::wire::recording_test {

using testing_support::TemporaryFolder;

SessionOptions Options() {
  SessionOptions options;
  options.name = "desk";
  options.camera = {.width_px = 64, .height_px = 48, .fx_px = 60, .fy_px = 61, .cx_px = 32, .cy_px = 24};
  options.mode = FrameMode::kLive;
  return options;
}

FrameInput NumberedFrame(uint64_t number) {
  FrameInput frame;
  frame.frame_id = number;
  frame.timestamp_ns = static_cast<int64_t>(number) * 40000000;
  frame.image_encoding = ImageEncoding::kPng;
  frame.image = std::string(100 + number, 'i');
  if (number % 2 == 0) {
    frame.mask_encoding = MaskEncoding::kLabelPng;
    frame.label_png = "mask";
    frame.instances = {{.label = 3, .class_name = "mug", .score = 0.5, .track_id = 8}};
  }
  frame.T_world_camera = SE3<World, Camera>(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 2, 3.25));
  return frame;
}

MasksInput MasksOf(uint64_t frame_id) {
  MasksInput masks;
  masks.frame_id = frame_id;
  static_cast<EncodedMasks&>(masks) = NumberedFrame(2);
  return masks;
}

class RecordingTest : public ::testing::Test {
 protected:
  std::string path() const { return folder_ / "session.romaprec"; }

  void WriteFrames(uint64_t count) const {
    auto writer = RecordingWriter::Create(path(), Options());
    ASSERT_TRUE(writer.ok()) << writer.status();
    for (uint64_t i = 1; i <= count; ++i) ASSERT_TRUE((*writer)->Append(NumberedFrame(i)).ok());
  }

  std::string Bytes() const {
    std::ifstream file(path(), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void SetBytes(const std::string& bytes) const { std::ofstream(path(), std::ios::binary) << bytes; }
  std::string OpenError() const {
    const auto recording = Recording::Open(path());
    EXPECT_EQ(recording.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(Message(recording.status()).find('\n'), std::string::npos);
    return Message(recording.status());
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(RecordingTest, RoundTrips) {
  WriteFrames(5);
  const auto recording = Recording::Open(path());
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_EQ(recording->options().name, "desk");
  EXPECT_EQ(recording->options().camera, Options().camera);
  EXPECT_EQ(recording->options().mode, FrameMode::kLive);
  EXPECT_EQ(recording->lost_bytes(), 0U);
  ASSERT_EQ(recording->size(), 5U);
  for (size_t i : {4U, 0U, 3U}) {  // in any order
    const FrameInput expected = NumberedFrame(i + 1);
    const auto input = recording->Load(i);
    ASSERT_TRUE(input.ok()) << input.status();
    const FrameInput* frame = std::get_if<FrameInput>(&*input);
    ASSERT_NE(frame, nullptr);
    EXPECT_EQ(frame->timestamp_ns, expected.timestamp_ns);
    EXPECT_EQ(frame->frame_id, expected.frame_id);
    EXPECT_EQ(frame->image, expected.image);
    EXPECT_EQ(frame->label_png, expected.label_png);
    EXPECT_EQ(frame->instances.size(), expected.instances.size());
    EXPECT_EQ(frame->T_world_camera->translation(), expected.T_world_camera->translation());
  }
  EXPECT_EQ(recording->Load(5).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(RecordingTest, KeepsTheOrderOfFramesAndLateMasks) {
  auto writer = RecordingWriter::Create(path(), Options());
  ASSERT_TRUE(writer.ok()) << writer.status();
  ASSERT_TRUE((*writer)->Append(NumberedFrame(1)).ok());
  ASSERT_TRUE((*writer)->Append(NumberedFrame(3)).ok());
  ASSERT_TRUE((*writer)->Append(MasksOf(1)).ok());
  ASSERT_TRUE((*writer)->Append(NumberedFrame(5)).ok());
  const auto recording = Recording::Open(path());
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_EQ(recording->size(), 4U);
  EXPECT_EQ(recording->frames(), 3U);
  EXPECT_EQ(std::get<FrameInput>(*recording->Load(1)).frame_id, 3U);
  const auto masks = std::get<MasksInput>(*recording->Load(2));
  EXPECT_EQ(masks.frame_id, 1U);
  EXPECT_EQ(masks.mask_encoding, MaskEncoding::kLabelPng);
  EXPECT_EQ(masks.label_png, "mask");
  EXPECT_EQ(masks.instances.at(0).class_name, "mug");
  EXPECT_EQ(std::get<FrameInput>(*recording->Load(3)).frame_id, 5U);
}

// The records of version 1 are Frames instead of MapRequests.
TEST_F(RecordingTest, ReadsVersionOne) {
  WriteFrames(0);
  std::string bytes = Bytes();
  bytes[8] = 1;
  const std::string frame = ToProto(NumberedFrame(2)).SerializeAsString();
  ASSERT_LT(frame.size(), 256U);
  bytes += std::string{static_cast<char>(frame.size()), 0, 0, 0} + frame;
  SetBytes(bytes);
  const auto recording = Recording::Open(path());
  ASSERT_TRUE(recording.ok()) << recording.status();
  ASSERT_EQ(recording->frames(), 1U);
  EXPECT_EQ(std::get<FrameInput>(*recording->Load(0)).frame_id, 2U);
  EXPECT_EQ(std::get<FrameInput>(*recording->Load(0)).label_png, "mask");
}

TEST_F(RecordingTest, AppendFlushesTheRecord) {
  auto writer = RecordingWriter::Create(path(), Options());
  ASSERT_TRUE(writer.ok()) << writer.status();
  ASSERT_TRUE((*writer)->Append(NumberedFrame(1)).ok());
  const auto recording = Recording::Open(path());  // while the writer is open
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_EQ(recording->size(), 1U);
}

TEST_F(RecordingTest, IgnoresOnlyTheIncompleteLastRecord) {
  WriteFrames(3);
  const std::string whole = Bytes();
  WriteFrames(2);
  const size_t two_frames = Bytes().size();
  for (size_t size = two_frames; size < whole.size(); ++size) {
    SetBytes(whole.substr(0, size));
    const auto recording = Recording::Open(path());
    ASSERT_TRUE(recording.ok()) << size << ": " << recording.status();
    ASSERT_EQ(recording->size(), 2U) << size;
    ASSERT_EQ(recording->lost_bytes(), size - two_frames);
    ASSERT_TRUE(recording->Load(1).ok());
  }
}

TEST_F(RecordingTest, RejectsOtherFiles) {
  EXPECT_EQ(Recording::Open(path()).status().code(), absl::StatusCode::kNotFound);
  SetBytes("");
  EXPECT_NE(OpenError().find("not a recording"), std::string::npos);
  SetBytes("\x89PNG\r\n\x1a\n and more");
  EXPECT_NE(OpenError().find(path() + ": not a recording: must start with ROMAPREC"), std::string::npos);
  std::filesystem::remove(path());
  std::filesystem::create_directory(path());
  EXPECT_EQ(Recording::Open(path()).status().code(), absl::StatusCode::kPermissionDenied);
  EXPECT_NE(Message(Recording::Open(path()).status()).find("Is a directory"), std::string::npos);
}

TEST_F(RecordingTest, RejectsUnknownVersions) {
  WriteFrames(1);
  std::string bytes = Bytes();
  bytes[8] = 7;
  SetBytes(bytes);
  EXPECT_NE(OpenError().find("version must be 1 to 2, is 7"), std::string::npos);
}

TEST_F(RecordingTest, NamesTheDamagedRecord) {
  WriteFrames(2);
  const std::string whole = Bytes();
  for (const size_t size : {8U, 10U, 14U, 20U}) {  // the header is incomplete
    SetBytes(whole.substr(0, size));
    EXPECT_NE(OpenError().find(path()), std::string::npos) << size;
  }
  std::string damaged = whole;
  damaged[damaged.find("iii") - 2] = '\x7f';  // the length of the image of frame 1
  SetBytes(damaged);
  EXPECT_NE(OpenError().find("record 1"), std::string::npos);
}

TEST_F(RecordingTest, ReportsWhyTheFileCannotBeWritten) {
  const auto writer = RecordingWriter::Create(folder_ / "missing/session.romaprec", Options());
  EXPECT_EQ(writer.status().code(), absl::StatusCode::kNotFound);
  EXPECT_NE(Message(writer.status()).find("missing/session.romaprec: cannot create the recording: No such file"),
            std::string::npos);
  const auto full = RecordingWriter::Create("/dev/full", Options());
  EXPECT_EQ(full.status().code(), absl::StatusCode::kResourceExhausted);
}

}  // namespace romap::wire::recording_test
