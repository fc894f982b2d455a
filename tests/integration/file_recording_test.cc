// Recordings whose files and lists differ from the plain case. Each must give the map of the sound sequence, or say
// what is wrong.

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/integration/recording_fixture.h"
#include "tests/support/test_png.h"

namespace romap::file_recording_test {

using recordings::kObjects;
using recordings::RunResult;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class FileRecordingTest : public recordings::RecordingTest {};

TEST_F(FileRecordingTest, PaletteMasks) {
  recording().Own("mask");
  for (const std::string& file : recording().Files("mask")) {
    const std::string bytes =
        testing_support::EncodeLabels(cv::imread(file, cv::IMREAD_UNCHANGED), testing_support::PngKind::kPalette, 8);
    std::ofstream(file, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  ExpectTheMap(Run());
}

TEST_F(FileRecordingTest, OneBitMasks) {
  recording().Own("mask");
  std::string detections = "timestamp,label,class,score\n";
  for (const std::string& stamp : recording().Stamps()) detections += stamp + ",1,box,0.9\n";
  recording().Write("detections.csv", detections);
  for (const std::string& file : recording().Files("mask")) {
    const cv::Mat object = cv::imread(file, cv::IMREAD_UNCHANGED) == 1;
    const std::string bytes = testing_support::EncodeLabels(object / 255, testing_support::PngKind::kGray, 1);
    std::ofstream(file, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  const RunResult result = Run();
  ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
  EXPECT_THAT(result.Classes(), ElementsAre("box"));
}

// Pixels as stored, with and without the tag.
TEST_F(FileRecordingTest, OrientationTags) {
  recording().Own("rgb");
  for (const std::string& file : recording().Files("rgb")) {
    std::ifstream in(file, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
    const std::string tagged = testing_support::WithOrientation(bytes, 6);
    std::ofstream(file, std::ios::binary).write(tagged.data(), static_cast<std::streamsize>(tagged.size()));
  }
  const RunResult result = Run();
  ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
  EXPECT_EQ(result.objects(), static_cast<size_t>(kObjects)) << result.process.out;
  EXPECT_EQ(result.summary["frames"]["rejected"], 0);
}

TEST_F(FileRecordingTest, AnEmptyImageIsSkipped) {
  recording().Own("rgb");
  std::ofstream(recording().Files("rgb")[30], std::ios::trunc).flush();
  const RunResult result = Run();
  ExpectTheMap(result);
  EXPECT_EQ(result.summary["frames"]["accepted"], recordings::kFrames - 1);
  EXPECT_THAT(result.Warnings(), Contains("file_unreadable"));
}

TEST_F(FileRecordingTest, AnEmptyMaskIsSkipped) {
  recording().Own("mask");
  std::ofstream(recording().Files("mask")[30], std::ios::trunc).flush();
  const RunResult result = Run();
  ExpectTheMap(result);
  EXPECT_EQ(result.summary["frames"]["accepted"], recordings::kFrames);
  EXPECT_THAT(result.Warnings(), Contains("file_unreadable"));
}

TEST_F(FileRecordingTest, TwelveBitsInSixteen) {
  const double sound = Run().MeanBrightness();
  recording().ChangeImages("rgb", [](const cv::Mat& image, size_t) {
    cv::Mat gray, wide;
    cv::cvtColor(image, gray, cv::COLOR_BGR2GRAY);
    gray.convertTo(wide, CV_16U, 16);
    return wide;
  });
  const RunResult result = Run();
  ExpectTheMap(result);
  // If the 12 bits were read as 16, the images would be nearly black: a sixteenth.
  EXPECT_GT(result.MeanBrightness(), 0.5 * sound);
  EXPECT_LT(result.MeanBrightness(), 2 * sound);
}

TEST_F(FileRecordingTest, ByteOrderMarksAndBlanks) {
  std::filesystem::rename(recording().Path("rgb"), recording().Path("my rgb"));
  recording().Replace("rgb.txt", "rgb/(\\S+)", "\"my rgb/$1\"");
  for (const char* file : {"rgb.txt", "mask.txt", "groundtruth.txt", "detections.csv"}) {
    recording().Write(file, "\xEF\xBB\xBF" + recording().Read(file));
  }
  const RunResult result = Run();
  ExpectTheMap(result);
  EXPECT_THAT(result.Codes(), IsEmpty());
}

TEST_F(FileRecordingTest, ClassNames) {
  recording().Replace("detections.csv", "^([0-9.]+),1,[^,]*,",
                      "$1,1,\"box #1; \"\"potted\"\", ..\\tea/B\xC3\xBC"
                      "ch\",");
  const RunResult result = Run();
  ExpectTheMap(result);
  EXPECT_THAT(result.Classes(), Contains("box #1; \"potted\", ..\\tea/B\xC3\xBC"
                                         "ch"));
}

TEST_F(FileRecordingTest, RoundedDetections) {
  recording().Replace("detections.csv", "^([0-9]+\\.[0-9])[0-9]*", "$1");
  const RunResult result = Run();
  ExpectTheMap(result);
  EXPECT_THAT(result.Codes(), Contains("detections_repeat"));
  EXPECT_THAT(result.Warnings(), IsEmpty()) << "a few masks have no row; their labels have no class";
}

}  // namespace romap::file_recording_test
