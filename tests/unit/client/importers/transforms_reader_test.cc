#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>

#include "tests/unit/client/importers/reading.h"

namespace romap::importers::transforms_reader_test {

using importers_testing::DiagnosticOf;
using importers_testing::Read;
using importers_testing::ReadError;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing_support::MakeSample;
using testing_support::SampleRecording;
using testing_support::WriteText;

TEST(TransformsReaderTest, ReadsNerfstudio) {
  const testing_support::TemporaryFolder folder;
  SampleRecording sample = MakeSample();
  sample.camera.distortion = {0.05, -0.01, 0.001, -0.002, 0};
  WriteTransformsLayout(sample, folder.path());
  ExpectSample(Read(folder.path()), sample, {.classes = false});
  ExpectSample(Read(folder / "transforms.json"), sample, {.classes = false});
}

TEST(TransformsReaderTest, ReadsInstantNgp) {
  const testing_support::TemporaryFolder folder;
  const SampleRecording sample = MakeSample();
  WriteTransformsLayout(sample, folder.path(), {.instant_ngp = true});
  ExpectSample(Read(folder.path()), sample, {.classes = false});
}

TEST(TransformsReaderTest, IntrinsicsOfEachFrame) {
  const testing_support::TemporaryFolder folder;
  const SampleRecording sample = MakeSample();
  WriteTransformsLayout(sample, folder.path(), {.per_frame_camera = true, .focal_change_px = 0.09});
  ExpectSample(Read(folder.path()), sample, {.classes = false});
}

// The last frame is enlarged: fl_x is 5 % larger, so its pixel u shows what pixel cx + 1.05 (u - cx) shows.
TEST(TransformsReaderTest, FramesOfOtherIntrinsicsAreResampled) {
  const testing_support::TemporaryFolder folder;
  const SampleRecording sample = MakeSample();
  WriteTransformsLayout(sample, folder.path(),
                        {.per_frame_camera = true, .focal_change_px = 0.05 * sample.camera.fx_px});
  const files::Sequence sequence = Read(folder.path());
  EXPECT_EQ(DiagnosticOf(sequence, "intrinsics_unified").count, 1u);
  const auto frame = sequence.Load(11);
  ASSERT_TRUE(frame.ok());
  const cv::Mat raw(1, static_cast<int>(frame->image.size()), CV_8UC1, const_cast<char*>(frame->image.data()));
  const cv::Mat image = cv::imdecode(raw, cv::IMREAD_COLOR);
  // SampleColor: blue is 40 + 4 u.
  const double u = sample.camera.cx_px + 1.05 * (10 - sample.camera.cx_px);
  EXPECT_NEAR(image.at<cv::Vec3b>(18, 10)[0], 40 + 4 * u, 1.5);
}

TEST(TransformsReaderTest, BlackAndWhiteMasksAreNoObjects) {
  const testing_support::TemporaryFolder folder;
  SampleRecording sample = MakeSample();
  for (testing_support::SampleFrame& frame : sample.frames) frame.labels = frame.labels == 1;
  WriteTransformsLayout(sample, folder.path());
  const files::Sequence sequence = Read(folder.path());
  EXPECT_FALSE(sequence.has_mask(0));
  EXPECT_EQ(DiagnosticOf(sequence, "masks_ignore_only").count, sample.frames.size());
}

TEST(TransformsReaderTest, ErrorsNameThePlace) {
  const testing_support::TemporaryFolder folder;
  const auto error = [&](const std::string& text) {
    WriteText(folder / "transforms.json", text);
    return ReadError(folder.path());
  };
  const std::string camera = R"("fl_x": 50, "w": 48, "h": 36)";
  const std::string identity = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]";
  EXPECT_THAT(error(R"({"frames": [)"), HasSubstr("transforms.json: invalid JSON"));
  EXPECT_THAT(error("{" + camera + R"(, "frames": []})"), HasSubstr("'frames' is empty"));
  EXPECT_THAT(error("{" + camera + R"(, "frames": [{"file_path": "a.png", "transform_matrix": [[1, 2], [3, 4]]}]})"),
              AllOf(HasSubstr("frame 0"), HasSubstr("4x4 matrix")));
  EXPECT_THAT(error(R"({"w": 48, "h": 36, "frames": [{"file_path": "a.png", "transform_matrix": )" + identity + "}]}"),
              HasSubstr("'fl_x'"));
  EXPECT_THAT(error(R"({"w": 48.5, "h": 36, "fl_x": 50, "frames": [{"file_path": "a.png", "transform_matrix": )" +
                    identity + "}]}"),
              AllOf(HasSubstr("'w' is 48.5"), HasSubstr("whole number")));
  EXPECT_THAT(error("{" + camera + R"(, "frames": [{"file_path": "a.png", "transform_matrix": )" + identity + "}]}"),
              AllOf(HasSubstr(folder / "a.png"), HasSubstr("does not exist"), HasSubstr("1 of 1 images")));
  EXPECT_THAT(error("{" + camera + R"(, "camera_model": "EQUIRECTANGULAR", "frames": [{"file_path": "a.png",
                    "transform_matrix": )" +
                    identity + "}]}"),
              HasSubstr("'EQUIRECTANGULAR' is not supported"));
}

}  // namespace romap::importers::transforms_reader_test
