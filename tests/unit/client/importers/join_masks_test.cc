#include "client/importers/join_masks.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <opencv2/core.hpp>

#include "client/importers/coco_masks.h"
#include "client/importers/mask_layers.h"
#include "common/label_png.h"
#include "tests/unit/client/importers/reading.h"

namespace romap::importers::join_masks_test {

using importers_testing::DiagnosticOf;
using importers_testing::Read;
using importers_testing::ReadError;
using importers_testing::SampleOptions;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing_support::MakeSample;
using testing_support::MaskLayout;
using testing_support::SampleChecks;
using testing_support::SampleRecording;
using testing_support::WriteImage;
using testing_support::WriteText;
namespace fs = std::filesystem;

class JoinMasksTest : public ::testing::Test {
 protected:
  JoinMasksTest() { WriteImageFolder(sample_, folder_ / "recording"); }

  std::string Recording() const { return folder_ / "recording"; }
  ReadOptions Options(const std::string& masks) const {
    ReadOptions options = SampleOptions();
    options.files.masks = masks;
    return options;
  }
  files::Sequence ReadWith(const std::string& masks) const { return Read(Recording(), Options(masks)); }
  std::string ErrorWith(const std::string& masks) const { return ReadError(Recording(), Options(masks)); }

  static constexpr SampleChecks kMasksOnly{.camera = false, .poses = false, .depth = false};
  static constexpr SampleChecks kMasksWithoutClasses{.camera = false, .poses = false, .depth = false, .classes = false};

  testing_support::TemporaryFolder folder_;
  SampleRecording sample_ = MakeSample();
};

TEST_F(JoinMasksTest, LabelImages) {
  WriteMasks(sample_, folder_ / "masks", MaskLayout::kLabelPng);
  ExpectSample(ReadWith(folder_ / "masks"), sample_, kMasksWithoutClasses);
}

TEST_F(JoinMasksTest, InTheFolderOfTheRecording) {
  WriteMasks(sample_, Recording() + "/my masks", MaskLayout::kLabelPng);
  ExpectSample(ReadWith("my masks"), sample_, kMasksWithoutClasses);
}

TEST_F(JoinMasksTest, InstanceFiles) {
  WriteMasks(sample_, folder_ / "masks", MaskLayout::kInstanceFiles);
  ExpectSample(ReadWith(folder_ / "masks"), sample_, kMasksWithoutClasses);
}

TEST_F(JoinMasksTest, InstanceFolders) {
  WriteMasks(sample_, folder_ / "masks", MaskLayout::kInstanceFolders);
  ExpectSample(ReadWith(folder_ / "masks"), sample_, kMasksOnly);
}

TEST_F(JoinMasksTest, Coco) {
  for (const MaskLayout layout : {MaskLayout::kCocoPolygons, MaskLayout::kCocoRuns, MaskLayout::kCocoCompressed}) {
    SCOPED_TRACE(static_cast<int>(layout));
    WriteMasks(sample_, folder_ / "instances.json", layout);
    ExpectSample(ReadWith(folder_ / "instances.json"), sample_, kMasksOnly);
  }
}

TEST_F(JoinMasksTest, Yolo) {
  WriteMasks(sample_, folder_ / "yolo", MaskLayout::kYolo);
  ExpectSample(ReadWith(folder_ / "yolo"), sample_, kMasksOnly);
  ExpectSample(ReadWith(folder_ / "yolo/labels"), sample_, kMasksOnly);
  fs::remove(folder_ / "yolo/data.yaml");
  WriteText(folder_ / "yolo/classes.txt", "background\ncup\nbook\n");
  ExpectSample(ReadWith(folder_ / "yolo"), sample_, kMasksOnly);
}

// Names that differ, with the same numbers.
TEST_F(JoinMasksTest, ByNumber) {
  for (size_t k = 0; k < sample_.frames.size(); ++k) {
    WriteImage(fmt::format("{}/seg_{}.png", folder_ / "masks", k), sample_.frames[k].labels);
  }
  const files::Sequence sequence = ReadWith(folder_ / "masks");
  ExpectSample(sequence, sample_, kMasksWithoutClasses);
  EXPECT_THAT(DiagnosticOf(sequence, "masks_joined").text, HasSubstr("12 of 12 frames, by the numbers"));
}

TEST_F(JoinMasksTest, MasksOfSomeFrames) {
  WriteMasks(sample_, folder_ / "masks", MaskLayout::kLabelPng);
  fs::remove(folder_ / "masks/000003.png");
  const files::Sequence sequence = ReadWith(folder_ / "masks");
  EXPECT_TRUE(sequence.has_mask(2));
  EXPECT_FALSE(sequence.has_mask(3));
}

TEST_F(JoinMasksTest, MasksOfAnotherSizeAreResized) {
  WriteImage(folder_ / "masks/000000.png", cv::Mat(18, 24, CV_8UC1, cv::Scalar(7)));
  const auto frame = ReadWith(folder_ / "masks").Load(0);
  ASSERT_TRUE(frame.ok());
  EXPECT_EQ(DecodeLabelPng(frame->label_png)->size(), cv::Size(48, 36));
}

TEST_F(JoinMasksTest, NoMaskFits) {
  WriteImage(folder_ / "masks/left.png", sample_.frames[0].labels);
  EXPECT_THAT(ErrorWith(folder_ / "masks"),
              AllOf(HasSubstr("none of the 1 masks has the name of a frame"), HasSubstr("a mask belongs to 'left'"),
                    HasSubstr("a frame is called '000000.png'")));
  EXPECT_THAT(ErrorWith(folder_ / "nowhere"), HasSubstr("nowhere: no such file or folder with masks"));
  fs::create_directories(folder_ / "empty");
  EXPECT_THAT(ErrorWith(folder_ / "empty"), AllOf(HasSubstr("no masks; found an empty folder"), HasSubstr("COCO")));
}

TEST_F(JoinMasksTest, MalformedFilesAreNamed) {
  WriteText(folder_ / "masks/000000.txt", "0 0.1 0.1 0.5 0.5\n");
  EXPECT_THAT(Message(ReadWith(folder_ / "masks").Load(0).status()),
              AllOf(HasSubstr("000000.txt:1"), HasSubstr("a box; expected a segmentation")));
  WriteText(folder_ / "masks/000000.txt", "0 10 10 50 10 50 50\n");
  EXPECT_THAT(Message(ReadWith(folder_ / "masks").Load(0).status()), HasSubstr("coordinate 10; expected 0 to 1"));
  WriteText(folder_ / "coco.json", R"({"images": [{"id": 1, "file_name": "000000.png", "width": 48, "height": 36}],
"categories": [{"id": 1, "name": "cup"}],
"annotations": [{"image_id": 1, "category_id": 1, "segmentation": {"size": [36, 48], "counts": [5, 6]}}]})");
  EXPECT_THAT(Message(ReadWith(folder_ / "coco.json").Load(0).status()),
              AllOf(HasSubstr("coco.json: annotation 0"), HasSubstr("sum to 11; expected 1728 pixels")));
  WriteText(folder_ / "coco.json", R"({"pictures": []})");
  EXPECT_THAT(ErrorWith(folder_ / "coco.json"), HasSubstr("the list 'categories' is missing"));
}

// Black pixels of COLMAP's masks are unknown in the masks of the objects.
TEST_F(JoinMasksTest, IgnoreMasksAreAppliedToTheMasks) {
  const std::string colmap = folder_ / "colmap";
  WriteColmapLayout(sample_, colmap, false);
  for (size_t k = 0; k < sample_.frames.size(); ++k) {
    cv::Mat kept(36, 48, CV_8UC1, cv::Scalar(255));
    kept.rowRange(0, 10) = 0;
    WriteImage(fmt::format("{}/masks/frame_{}.png.png", colmap, k), kept);
    WriteImage(fmt::format("{}/frame_{}.png", folder_ / "objects", k), sample_.frames[k].labels);
  }
  const auto frame = Read(colmap, Options(folder_ / "objects")).Load(0);
  ASSERT_TRUE(frame.ok());
  const auto labels = DecodeLabelPng(frame->label_png);
  ASSERT_TRUE(labels.ok());
  EXPECT_EQ(cv::countNonZero(labels->rowRange(0, 10) != 65535), 0);
  EXPECT_EQ(cv::countNonZero(labels->rowRange(10, 36) != sample_.frames[0].labels.rowRange(10, 36)), 0);
}

TEST(CocoMasksTest, DamagedRunLengths) {
  EXPECT_THAT(Message(DecodeCocoRuns("P").status()), HasSubstr("truncated"));
  EXPECT_THAT(Message(DecodeCocoRuns("5 ").status()), HasSubstr("contain ' '"));
  EXPECT_EQ(*DecodeCocoRuns("52203"), (std::vector<uint32_t>{5, 2, 2, 2, 5}));  // 0 and 3 are differences
}

TEST(MaskLayersTest, PolygonsCoverThePixelsWhoseCentersAreInside) {
  const cv::Mat mask = FillPolygon({1.4, 0, 4.4, 0, 4.4, 2.6, 1.4, 2.6}, cv::Size(6, 4));
  EXPECT_EQ(cv::countNonZero(mask), 3 * 3);
  EXPECT_EQ(mask.at<uint8_t>(0, 1), 255);
  EXPECT_EQ(mask.at<uint8_t>(2, 3), 255);
  EXPECT_EQ(mask.at<uint8_t>(0, 4), 0);
}

TEST(MaskLayersTest, SmallLayersAreInFront) {
  cv::Mat large(4, 4, CV_8UC1, cv::Scalar(255)), small = cv::Mat::zeros(4, 4, CV_8UC1);
  small.at<uint8_t>(1, 1) = 1;
  const EncodedMasks masks = EncodeLayers({{small, "cup"}, {large, "table", 0.5}}, cv::Size(4, 4));
  const auto labels = DecodeLabelPng(masks.label_png);
  ASSERT_TRUE(labels.ok());
  EXPECT_EQ(labels->at<uint16_t>(1, 1), 1);
  EXPECT_EQ(labels->at<uint16_t>(0, 0), 2);
  EXPECT_EQ(masks.instances[1].class_name, "table");
}

}  // namespace romap::importers::join_masks_test
