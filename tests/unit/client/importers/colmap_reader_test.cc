#include <gmock/gmock.h>

#include <filesystem>

#include "client/importers/colmap_model.h"
#include "tests/unit/client/importers/reading.h"

namespace romap::importers::colmap_reader_test {

using importers_testing::Read;
using importers_testing::ReadError;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing_support::MakeSample;
using testing_support::SampleRecording;
using testing_support::WriteText;
namespace fs = std::filesystem;

class ColmapReaderTest : public ::testing::TestWithParam<bool> {
 protected:
  ColmapReaderTest() {
    sample_.camera.distortion = {0.05, -0.01, 0.001, -0.002, 0};
    WriteColmapLayout(sample_, folder_.path(), GetParam());
  }
  std::string ModelFile(const std::string& name) const {
    return folder_ / "sparse/0/" + name + (GetParam() ? ".bin" : ".txt");
  }

  testing_support::TemporaryFolder folder_;
  SampleRecording sample_ = MakeSample();
};

INSTANTIATE_TEST_SUITE_P(TextAndBinary, ColmapReaderTest, ::testing::Bool());

TEST_P(ColmapReaderTest, ReadsTheModel) {
  const files::Sequence sequence = Read(folder_.path());
  ExpectSample(sequence, sample_, {.depth = false, .classes = false});
  EXPECT_EQ(sequence.world_up(), "auto");
}

TEST_P(ColmapReaderTest, ReadsTheModelFolder) {
  ExpectSample(Read(folder_ / "sparse/0"), sample_, {.depth = false, .masks = false});
}

TEST_P(ColmapReaderTest, AnEmptyModelIsAnError) {
  WriteText(ModelFile("images"), GetParam() ? std::string(8, '\0') : "# Image list\n");
  EXPECT_THAT(ReadError(folder_.path()), AllOf(HasSubstr("sparse/0"), HasSubstr("has no images")));
}

TEST_P(ColmapReaderTest, ATruncatedModelIsAnError) {
  const std::string path = ModelFile("images");
  fs::resize_file(path, GetParam() ? fs::file_size(path) - 20 : 60);
  EXPECT_THAT(ReadError(folder_.path()), AllOf(HasSubstr(path), HasSubstr(GetParam() ? "truncated" : "expected 'id")));
}

TEST_P(ColmapReaderTest, MissingImagesAreNamed) {
  fs::remove_all(folder_ / "images");
  EXPECT_THAT(ReadError(folder_.path()), AllOf(HasSubstr("frame_0.png"), HasSubstr("does not exist")));
}

TEST_P(ColmapReaderTest, ScaledImagesAreAnError) {
  for (size_t k = 0; k < sample_.frames.size(); ++k) {
    testing_support::WriteImage(fmt::format("{}/frame_{}.png", folder_ / "images", k), cv::Mat::zeros(18, 24, CV_8UC3));
  }
  EXPECT_THAT(ReadError(folder_.path()), HasSubstr("frame_0.png: 24x18 px; the calibration is for 48x36 px"));
}

TEST_P(ColmapReaderTest, AnUnknownCameraIsNamed) {
  WriteText(ModelFile("cameras"), GetParam() ? std::string(8, '\0') : "# none\n");
  EXPECT_THAT(ReadError(folder_.path()), HasSubstr("has camera 7, which is not in the list"));
}

// A count in a damaged file must not lead to a huge allocation.
TEST(ColmapModelTest, HugeCountsAreTruncations) {
  const testing_support::TemporaryFolder folder;
  WriteText(folder / "cameras.bin", std::string(8, '\0'));
  WriteText(folder / "images.bin", std::string(8, '\xff'));
  EXPECT_THAT(Message(ReadColmapModel(folder.path()).status()), HasSubstr("truncated at byte 8"));
}

CameraModel CameraOf(const std::string& model, const std::vector<double>& parameters) {
  const auto camera = ColmapCamera(model, 640, 480, parameters, "cameras.txt:1");
  EXPECT_TRUE(camera.ok()) << camera.status();
  return camera.value_or(CameraModel());
}

TEST(ColmapModelTest, CameraModels) {
  CameraModel expected{.width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500, .cx_px = 319.5, .cy_px = 239.5};
  EXPECT_EQ(CameraOf("SIMPLE_PINHOLE", {500, 320, 240}), expected);
  EXPECT_EQ(CameraOf("PINHOLE", {500, 500, 320, 240}), expected);
  expected.distortion = {0.1, 0, 0, 0, 0};
  EXPECT_EQ(CameraOf("SIMPLE_RADIAL", {500, 320, 240, 0.1}), expected);
  expected.distortion = {0.1, 0.2, 0, 0, 0};
  EXPECT_EQ(CameraOf("RADIAL", {500, 320, 240, 0.1, 0.2}), expected);
  expected.fy_px = 510;
  expected.distortion = {0.1, 0.2, 0.3, 0.4, 0};
  EXPECT_EQ(CameraOf("OPENCV", {500, 510, 320, 240, 0.1, 0.2, 0.3, 0.4}), expected);
  expected.distortion = {0.1, 0.2, 0.3, 0.4, 0.5};
  EXPECT_EQ(CameraOf("FULL_OPENCV", {500, 510, 320, 240, 0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0}), expected);
  expected.distortion = {0.1, 0.2, 0.3, 0.4, 0};
  expected.lens = LensModel::kFisheye;
  EXPECT_EQ(CameraOf("OPENCV_FISHEYE", {500, 510, 320, 240, 0.1, 0.2, 0.3, 0.4}), expected);
}

TEST(ColmapModelTest, UnsupportedCameraModelsAreNamed) {
  const auto error = [](const std::string& model, const std::vector<double>& parameters) {
    return Message(ColmapCamera(model, 640, 480, parameters, "cameras.txt:1").status());
  };
  EXPECT_THAT(error("FULL_OPENCV", {500, 510, 320, 240, 0.1, 0.2, 0.3, 0.4, 0.5, 0, 0.01, 0}),
              AllOf(HasSubstr("cameras.txt:1"), HasSubstr("FULL_OPENCV with k4 = 0, k5 = 0.01")));
  EXPECT_THAT(error("FOV", {500, 510, 320, 240, 0.9}), HasSubstr("FOV is not supported; undistort"));
  EXPECT_THAT(error("PINHOLE", {500, 320, 240}), HasSubstr("3 parameters; PINHOLE has 4"));
}

}  // namespace romap::importers::colmap_reader_test
