#include "client/files/sequence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "common/label_png.h"
#include "tests/support/test_png.h"

namespace romap::files::sequence_test {

using ::testing::AllOf;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

// Each test gets a new sequence of four frames at 10 Hz.
class SequenceTest : public testing::Test {
 protected:
  void SetUp() override {
    dir_ = testing::TempDir() + "romap_sequence_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(dir_);
    fs::create_directories(dir_ + "/rgb");
    fs::create_directories(dir_ + "/mask");
    fs::create_directories(dir_ + "/depth");
    Put("camera.yaml", "width: 32\nheight: 24\nfx: 30\nfy: 31\ncx: 15.5\ncy: 11.5\nfps: 10\ndepth_scale: 0.001\n");
    Put("rgb.txt", "# rgb\n0.0 rgb/0.png\n0.1 rgb/1.png\n0.2 rgb/2.png\n0.3 rgb/3.png\n");
    for (int k = 0; k < 4; ++k) {
      const std::string name = std::to_string(k) + ".png";
      cv::imwrite(dir_ + "/rgb/" + name, cv::Mat(24, 32, CV_8UC3, cv::Scalar(k, 2 * k, 3 * k)));
      cv::Mat labels = cv::Mat::zeros(24, 32, CV_8UC1);
      labels.colRange(0, 10) = 1;
      labels.colRange(10, 20) = 2;
      cv::imwrite(dir_ + "/mask/" + name, labels);
      cv::imwrite(dir_ + "/depth/" + name, cv::Mat(24, 32, CV_16UC1, cv::Scalar(1000 + k)));
    }
  }
  void TearDown() override { fs::remove_all(dir_); }

  void Put(const std::string& name, const std::string& text) {
    std::ofstream(dir_ + "/" + name, std::ios::binary) << text;
  }

  // The error message of Open; "" on success.
  std::string OpenError(const SequenceOptions& options = {}) {
    const auto sequence = Sequence::Open(dir_, options);
    return sequence.ok() ? "" : std::string(sequence.status().message());
  }

  std::string dir_;
};

TEST_F(SequenceTest, LoadReturnsTheBytesOfTheImageFile) {
  const auto sequence = Sequence::Open(dir_);
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  EXPECT_EQ(sequence->size(), 4u);
  EXPECT_EQ(sequence->camera().width_px, 32);
  EXPECT_EQ(sequence->fps(), 10);
  const auto frame = sequence->Load(2);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->frame_id, 3u);
  EXPECT_EQ(frame->timestamp_ns, 200'000'000);
  EXPECT_EQ(frame->image_encoding, ImageEncoding::kPng);
  std::ifstream file(dir_ + "/rgb/2.png", std::ios::binary);
  EXPECT_EQ(frame->image, std::string(std::istreambuf_iterator<char>(file), {}));
  EXPECT_EQ(frame->mask_encoding, MaskEncoding::kNone);
  EXPECT_FALSE(frame->T_world_camera.has_value());
}

TEST_F(SequenceTest, AssociatesMasksAndDetectionsByTime) {
  Put("mask.txt", "0.004 mask/0.png\n0.196 mask/2.png\n0.9 mask/3.png\n");
  Put("detections.csv", "timestamp,label,class,score\n0.004,1,cup,0.5\n0.004,2,potted plant,0.25\n0.196,1,book,1\n");
  const auto sequence = Sequence::Open(dir_);
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  EXPECT_TRUE(sequence->has_mask(0));
  EXPECT_FALSE(sequence->has_mask(1));
  EXPECT_TRUE(sequence->has_mask(2));
  EXPECT_FALSE(sequence->has_mask(3)) << "the nearest mask is 0.6 s later";
  const auto frame = sequence->Load(0);
  ASSERT_TRUE(frame.ok());
  ASSERT_EQ(frame->instances.size(), 2u);
  EXPECT_EQ(frame->instances[1].class_name, "potted plant");
  EXPECT_EQ(frame->instances[1].label, 2u);
  EXPECT_EQ(frame->instances[1].score, 0.25);
  EXPECT_TRUE(sequence->Load(1)->instances.empty());
}

TEST_F(SequenceTest, UsesLabelsOfObjectsYamlWithoutDetections) {
  Put("mask.txt", "0.0 mask/0.png\n0.1 mask/1.png\n");
  Put("objects.yaml",
      "objects:\n  - id: 2\n    name: a\n    class: cup\n    center: [0, 0, 1]\n    yaw: 0.5\n"
      "    half_extents: [0.1, 0.2, 0.3]\n");
  const auto sequence = Sequence::Open(dir_);
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  ASSERT_TRUE(sequence->objects().has_value());
  const auto frame = sequence->Load(1);
  ASSERT_EQ(frame->instances.size(), 1u);
  EXPECT_EQ(frame->instances[0].label, 2u);
  EXPECT_EQ(frame->instances[0].class_name, "cup");
}

TEST_F(SequenceTest, InterpolatesPosesButNotAcrossGaps) {
  Put("groundtruth.txt", "-0.01 0 0 0 0 0 0 1\n0.01 2 0 0 0 0 0 1\n0.115 5 0 0 0 0 0 1\n0.15 9 9 9 0 0 0 1\n");
  const auto sequence = Sequence::Open(dir_);
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  EXPECT_NEAR(sequence->Load(0)->T_world_camera->translation().x(), 1, 1e-12);
  EXPECT_NEAR(sequence->Load(1)->T_world_camera->translation().x(), 5, 1e-12) << "neighbors 105 ms apart: nearest pose";
  EXPECT_FALSE(sequence->Load(2)->T_world_camera.has_value());
  const auto without_poses = Sequence::Open(dir_, {.poses = ""});
  EXPECT_FALSE(without_poses->Load(0)->T_world_camera.has_value());
}

TEST_F(SequenceTest, LoadsDepthOnlyOnRequest) {
  Put("depth.txt", "0 depth/0.png\n0.1 depth/1.png\n0.2 depth/2.png\n0.3 depth/3.png\n");
  EXPECT_EQ(Sequence::Open(dir_)->Load(1)->depth_encoding, DepthEncoding::kNone);
  const auto frame = Sequence::Open(dir_, {.use_depth = true})->Load(1);
  ASSERT_TRUE(frame.ok());
  EXPECT_EQ(frame->depth_encoding, DepthEncoding::kPng16);
  EXPECT_EQ(frame->depth_scale_mu, 0.001);
  EXPECT_FALSE(frame->depth.empty());
}

TEST_F(SequenceTest, PermutedLabelsKeepShapesAndClasses) {
  Put("mask.txt", "0 mask/0.png\n0.1 mask/1.png\n0.2 mask/2.png\n0.3 mask/3.png\n");
  Put("detections.csv", "0,1,cup,1\n0,2,book,1\n0.1,1,cup,1\n0.1,2,book,1\n0.2,1,cup,1\n0.3,1,cup,1\n");
  const auto sequence = Sequence::Open(dir_, {.permute_labels_seed = 7});
  ASSERT_TRUE(sequence.ok());
  std::set<uint32_t> cup_labels;
  for (size_t k = 0; k < 4; ++k) {
    const auto frame = sequence->Load(k);
    ASSERT_TRUE(frame.ok()) << frame.status();
    const cv::Mat labels =
        cv::imdecode(std::vector<uint8_t>(frame->label_png.begin(), frame->label_png.end()), cv::IMREAD_UNCHANGED);
    for (const Instance& instance : frame->instances) {
      const int column = instance.class_name == "cup" ? 5 : 15;
      EXPECT_EQ(labels.at<uint8_t>(12, column), instance.label);
      if (instance.class_name == "cup") cup_labels.insert(instance.label);
    }
    EXPECT_EQ(labels.at<uint8_t>(12, 25), 0) << "background";
  }
  EXPECT_GT(cup_labels.size(), 1u);
  EXPECT_EQ(sequence->Load(1)->label_png, sequence->Load(1)->label_png) << "the same seed gives the same labels";
}

TEST_F(SequenceTest, NamesTheMissingFile) {
  EXPECT_THAT(std::string(Sequence::Open(dir_ + "/nowhere").status().message()), HasSubstr("no such sequence folder"));
  EXPECT_THAT(OpenError({.masks = "mask_other.txt"}), HasSubstr("mask_other.txt: cannot read: No such file"));
  EXPECT_THAT(OpenError({.use_depth = true}), HasSubstr("depth.txt: cannot read: No such file"));
  fs::remove(dir_ + "/camera.yaml");
  EXPECT_THAT(OpenError(), HasSubstr("camera.yaml is missing"));
  fs::remove(dir_ + "/rgb.txt");
  EXPECT_THAT(OpenError(), AllOf(HasSubstr(dir_), HasSubstr("rgb.txt is missing")));
}

TEST_F(SequenceTest, NamesTheFileAndLineOfMalformedInput) {
  Put("rgb.txt", "0.0 rgb/0.png\n0.1\n");
  EXPECT_THAT(OpenError(), HasSubstr("rgb.txt:2: expected 'timestamp filename'"));
  Put("rgb.txt", "0.0 rgb/0.png\nnan rgb/1.png\n");
  EXPECT_THAT(OpenError(), HasSubstr("rgb.txt:2"));
  Put("rgb.txt", "0.1 rgb/0.png\n0.0 rgb/1.png\n");
  EXPECT_THAT(OpenError(), HasSubstr("rgb.txt:2: timestamps must increase"));
  Put("rgb.txt", "# nothing\n");
  EXPECT_THAT(OpenError(), HasSubstr("no frames listed"));
  Put("rgb.txt", "0.0 rgb/missing.png\n");
  EXPECT_THAT(OpenError(), AllOf(HasSubstr("rgb.txt:1"), HasSubstr("rgb/missing.png")));
  Put("rgb.txt", "0.0 rgb/0.png\n");
  Put("detections.csv", "timestamp,label,class,score\n0.0,300000,cup,1\n");
  EXPECT_THAT(OpenError(), HasSubstr("detections.csv:2: label '300000'"));
  Put("detections.csv", "0.0,1,cup,inf\n");
  EXPECT_THAT(OpenError(), HasSubstr("detections.csv:1: score 'inf'"));
  Put("camera.yaml", "width: 32\nheight: 24\nfx: -1\nfy: 31\ncx: 15.5\ncy: 11.5\n");
  EXPECT_THAT(OpenError(), HasSubstr("camera.yaml"));
}

TEST_F(SequenceTest, NamesAFileThatIsNotAnImage) {
  Put("rgb/1.png", "not an image");
  Put("mask.txt", "0 mask/0.png\n");
  Put("mask/0.png", "");
  const auto sequence = Sequence::Open(dir_);
  ASSERT_TRUE(sequence.ok());
  EXPECT_THAT(std::string(sequence->Load(1).status().message()), HasSubstr("rgb/1.png: neither a PNG nor a JPEG"));
  EXPECT_THAT(std::string(sequence->Load(0).status().message()), HasSubstr("mask/0.png: the file is empty"));
  EXPECT_FALSE(sequence->Load(4).ok());
}

TEST_F(SequenceTest, SoundInputHasNoDiagnostics) {
  Put("mask.txt", "0.0 mask/0.png\n0.1 mask/1.png\n0.2 mask/2.png\n");
  Put("detections.csv", "timestamp,label,class,score\n0.0,1,cup,0.5\n0.0,2,cup,0.5\n0.2,1,book,1\n");
  Put("groundtruth.txt", "-0.01 0 0 0 0 0 0 1\n0.31 2 0 0 0 0 0 1\n0.105 0 0 0 0 0 0 1\n0.2 0 0 0 0 0 0 1\n");
  Put("depth.txt", "0 depth/0.png\n0.1 depth/1.png\n");
  const auto sequence = Sequence::Open(dir_, {.use_depth = true});
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  EXPECT_TRUE(sequence->diagnostics().empty()) << sequence->diagnostics().front().text;
}

TEST_F(SequenceTest, MatchesListsInDifferentUnits) {
  Put("groundtruth.txt",
      "0 0 0 0 0 0 0 1\n100000000 1 0 0 0 0 0 1\n200000000 2 0 0 0 0 0 1\n300000000 3 0 0 0 0 0 1\n");
  Put("mask.txt", "0 mask/0.png\n100000 mask/1.png\n200000 mask/2.png\n300000 mask/3.png\n");
  const auto sequence = Sequence::Open(dir_);
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  EXPECT_EQ(sequence->Load(3)->T_world_camera->translation().x(), 3);
  EXPECT_TRUE(sequence->has_mask(3));
  ASSERT_EQ(sequence->diagnostics().size(), 1u);
  const Diagnostic& diagnostic = sequence->diagnostics()[0];
  EXPECT_EQ(diagnostic.code, "timestamps_converted");
  EXPECT_EQ(diagnostic.severity, Severity::kInfo);
  EXPECT_THAT(diagnostic.text,
              AllOf(HasSubstr("mask.txt in microseconds"), HasSubstr("groundtruth.txt in nanoseconds")));
}

TEST_F(SequenceTest, ReportsListsOfAnotherTime) {
  Put("mask.txt", "5.0 mask/0.png\n5.1 mask/1.png\n");
  Put("groundtruth.txt", "100 0 0 0 0 0 0 1\n100.5 0 0 0 0 0 0 1\n");
  const auto sequence = Sequence::Open(dir_);
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  ASSERT_EQ(sequence->diagnostics().size(), 2u);
  EXPECT_EQ(sequence->diagnostics()[0].code, "masks_unmatched");
  const Diagnostic& poses = sequence->diagnostics()[1];
  EXPECT_EQ(poses.code, "poses_unmatched");
  EXPECT_EQ(poses.severity, Severity::kWarning);
  EXPECT_THAT(poses.text,
              AllOf(HasSubstr("none of the 2 poses of groundtruth.txt"),
                    HasSubstr("poses are from 100.000 s to 100.500 s"), HasSubstr("frames from 0.000 s to 0.300 s")));
  EXPECT_THAT(poses.advice, HasSubstr("tracked from the images"));
}

TEST_F(SequenceTest, ReportsFramesWithoutPose) {
  Put("groundtruth.txt", "0.1 0 0 0 0 0 0 1\n0.2 0 0 0 0 0 0 1\n0.3 0 0 0 0 0 0 1\n");
  const auto most = Sequence::Open(dir_);
  ASSERT_EQ(most->diagnostics().size(), 1u);
  EXPECT_EQ(most->diagnostics()[0].code, "poses_partial");
  EXPECT_EQ(most->diagnostics()[0].severity, Severity::kInfo);
  EXPECT_EQ(most->diagnostics()[0].count, 1u);
  EXPECT_EQ(most->diagnostics()[0].first_frame_id, 1u);
  EXPECT_THAT(most->diagnostics()[0].text, HasSubstr("3 of 4 frames"));
  Put("groundtruth.txt", "0.0 0 0 0 0 0 0 1\n");
  EXPECT_EQ(Sequence::Open(dir_)->diagnostics()[0].severity, Severity::kWarning);
  EXPECT_TRUE(Sequence::Open(dir_, {.poses = ""})->diagnostics().empty());
}

TEST_F(SequenceTest, CountsDetectionsWithoutMask) {
  Put("mask.txt", "0.0 mask/0.png\n0.1 mask/1.png\n");
  Put("detections.csv", "0.0,1,cup,90\n0.1,1,cup,80\n0.25,1,cup,70\n0.25,2,pen,70\n");
  const auto sequence = Sequence::Open(dir_);
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  EXPECT_DOUBLE_EQ(sequence->Load(0)->instances[0].score, 0.9);
  ASSERT_EQ(sequence->diagnostics().size(), 2u);
  EXPECT_EQ(sequence->diagnostics()[0].code, "scores_percent");
  const Diagnostic& unmatched = sequence->diagnostics()[1];
  EXPECT_EQ(unmatched.code, "detections_unmatched");
  EXPECT_EQ(unmatched.severity, Severity::kInfo) << "all masks have rows";
  EXPECT_EQ(unmatched.count, 2u);
  EXPECT_THAT(unmatched.text, HasSubstr("2 of 4 rows of detections.csv match no mask in time, the first at 0.250 s in "
                                        "line 3"));
  Put("detections.csv", "0.1,1,cup,0.8\n0.25,1,cup,0.7\n");
  const auto displaced = Sequence::Open(dir_);
  ASSERT_TRUE(displaced.ok()) << displaced.status();
  ASSERT_EQ(displaced->diagnostics().size(), 1u);
  EXPECT_EQ(displaced->diagnostics()[0].severity, Severity::kWarning);
  EXPECT_THAT(displaced->diagnostics()[0].text, HasSubstr("1 masks have no row"));
}

TEST_F(SequenceTest, ReadsYamlWithByteOrderMark) {
  Put("camera.yaml", "\xEF\xBB\xBFwidth: 32\r\nheight: 24\r\nfx: 30\r\nfy: 31\r\ncx: 15.5\r\ncy: 11.5\r\n");
  EXPECT_EQ(OpenError(), "");
}

TEST_F(SequenceTest, OmitsMasksAndDepthThatCannotBeRead) {
  Put("mask.txt", "0 mask/0.png\n0.1 mask/1.png\n0.2 mask/2.png\n0.3 mask/3.png\n");
  Put("depth.txt", "0 depth/0.png\n0.1 depth/1.png\n0.2 depth/2.png\n0.3 depth/3.png\n");
  Put("mask/0.png", "");
  fs::resize_file(dir_ + "/mask/1.png", fs::file_size(dir_ + "/mask/1.png") - 5);
  fs::resize_file(dir_ + "/depth/1.png", 30);
  const auto sequence = Sequence::Open(dir_, {.use_depth = true});
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  fs::remove(dir_ + "/rgb/3.png");

  std::vector<UnreadableFile> unreadable;
  const auto frame = sequence->LoadReadable(1, &unreadable);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->mask_encoding, MaskEncoding::kNone);
  EXPECT_EQ(frame->depth_encoding, DepthEncoding::kNone);
  ASSERT_EQ(unreadable.size(), 2u);
  EXPECT_EQ(unreadable[0].kind, FileKind::kMask);
  EXPECT_THAT(std::string(unreadable[0].reason.message()), HasSubstr("mask/1.png: PNG file is truncated"));
  EXPECT_EQ(unreadable[1].kind, FileKind::kDepth);
  EXPECT_THAT(std::string(unreadable[1].reason.message()), HasSubstr("depth/1.png: PNG file is truncated"));
  EXPECT_FALSE(sequence->Load(1).ok());
  EXPECT_EQ(sequence->LoadReadable(3, &unreadable).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(SequenceTest, PermutesPaletteMasks) {
  cv::Mat labels = cv::Mat::zeros(24, 32, CV_8UC1);
  labels.colRange(0, 10) = 1;
  Put("mask/0.png", testing_support::EncodeLabels(labels, testing_support::PngKind::kPalette, 1));
  Put("mask.txt", "0 mask/0.png\n");
  Put("detections.csv", "0,1,cup,1\n");
  const auto frame = Sequence::Open(dir_, {.permute_labels_seed = 7})->Load(0);
  ASSERT_TRUE(frame.ok()) << frame.status();
  const auto permuted = DecodeLabelPng(frame->label_png);
  ASSERT_TRUE(permuted.ok()) << permuted.status();
  EXPECT_EQ(permuted->at<uint16_t>(12, 5), frame->instances[0].label);
  EXPECT_EQ(permuted->at<uint16_t>(12, 15), 0);
}

TEST(SequenceDataTest, OpensASequenceWithDepthAndMasks) {
  const char* data_dir = std::getenv("ROMAP_DATA_DIR");
  if (data_dir == nullptr) GTEST_SKIP() << "ROMAP_DATA_DIR is not set";
  const auto room = Sequence::Open(std::string(data_dir) + "/cube_diorama_room", {.use_depth = true});
  ASSERT_TRUE(room.ok()) << room.status();
  EXPECT_EQ(room->size(), 100u);
  for (const size_t index : {0u, 99u}) {
    const auto frame = room->Load(index);
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->instances.size(), 4u);
    EXPECT_TRUE(frame->T_world_camera.has_value());
    EXPECT_NE(frame->depth_encoding, DepthEncoding::kNone);
  }
}

TEST(SequenceDataTest, OpensASequenceWithMasksInEverySecondFrame) {
  const char* data_dir = std::getenv("ROMAP_DATA_DIR");
  if (data_dir == nullptr) GTEST_SKIP() << "ROMAP_DATA_DIR is not set";
  const auto kitchen = Sequence::Open(std::string(data_dir) + "/redkitchen_600",
                                      {.masks = "mask_yolo.txt", .detections = "detections_yolo.csv"});
  ASSERT_TRUE(kitchen.ok()) << kitchen.status();
  EXPECT_EQ(kitchen->size(), 600u);
  size_t masks = 0;
  for (size_t k = 0; k < kitchen->size(); ++k) masks += kitchen->has_mask(k);
  EXPECT_GT(masks, 290u);
  EXPECT_FALSE(kitchen->has_mask(1));
  ASSERT_EQ(kitchen->Load(2)->instances.size(), 2u);
  EXPECT_EQ(kitchen->Load(2)->instances[1].class_name, "cup");
}

}  // namespace romap::files::sequence_test
