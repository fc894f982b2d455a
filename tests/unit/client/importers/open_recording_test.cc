#include "client/importers/open_recording.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "client/files/text_file.h"
#include "client/importers/calibration_guess.h"
#include "client/importers/folder.h"
#include "client/importers/import_sequence.h"
#include "tests/unit/client/importers/reading.h"

namespace romap::importers::open_recording_test {

using importers_testing::DiagnosticOf;
using importers_testing::Read;
using importers_testing::ReadError;
using importers_testing::SampleOptions;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing_support::MakeSample;
using testing_support::SampleChecks;
using testing_support::SampleRecording;
using testing_support::WriteImage;
using testing_support::WriteText;
namespace fs = std::filesystem;

bool Proceed(size_t) { return true; }

TEST(OpenRecordingTest, UnknownLayouts) {
  const testing_support::TemporaryFolder folder;
  EXPECT_THAT(ReadError(folder / "nowhere"), HasSubstr("nowhere: no such file or folder"));
  EXPECT_THAT(ReadError(folder.path()), HasSubstr("found an empty folder"));
  WriteText(folder / "notes.txt", "nothing\n");
  WriteText(folder / "raw/data.bin", "nothing");
  const std::string error = ReadError(folder.path());
  EXPECT_THAT(error, AllOf(HasSubstr("not a known layout"), HasSubstr("found raw/, notes.txt"),
                           HasSubstr("COLMAP model (cameras and images"), HasSubstr("transforms.json"),
                           HasSubstr("BOP scene (scene_camera.json"), HasSubstr("rgb.txt and camera.yaml")));
  EXPECT_EQ(error.find('\n'), std::string::npos);
}

TEST(OpenRecordingTest, SaysHowTheRecordingIsRead) {
  const testing_support::TemporaryFolder folder;
  WriteImageFolder(MakeSample(), folder.path());
  EXPECT_EQ(DiagnosticOf(Read(folder.path()), "layout").text, "read as folder of images");
}

TEST(OpenRecordingTest, OptionsApplyToAllLayouts) {
  const testing_support::TemporaryFolder folder;
  const SampleRecording sample = MakeSample();
  WriteTransformsLayout(sample, folder.path());
  ReadOptions options = SampleOptions();
  options.every = 3;
  options.focal_px = 77;
  options.files.use_depth = false;
  options.files.poses.clear();
  options.files.readout_s = 0.02;
  const files::Sequence sequence = Read(folder.path(), options);
  EXPECT_EQ(sequence.size(), 4u);
  EXPECT_EQ(sequence.timestamp_ns(1), 300'000'000);
  EXPECT_EQ(sequence.camera().fy_px, 77);
  EXPECT_EQ(sequence.camera().readout_s, 0.02);
  EXPECT_FALSE(sequence.frame(0).T_world_camera);
  EXPECT_TRUE(sequence.paths(0).depth.empty());
}

TEST(ImageFolderReaderTest, SortsByNumberAndReadsOtherFormats) {
  const testing_support::TemporaryFolder folder;
  const SampleRecording sample = MakeSample();
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    WriteImage(fmt::format("{}/shot_{}.{}", folder.path(), k, k % 2 == 0 ? "bmp" : "png"), sample.frames[k].color);
  }
  const SampleChecks images{.camera = false, .poses = false, .depth = false, .masks = false};
  ExpectSample(Read(folder.path()), sample, images);
}

TEST(ImageFolderReaderTest, TakesACalibrationBesideTheImages) {
  const testing_support::TemporaryFolder folder;
  const SampleRecording sample = MakeSample();
  WriteImageFolder(sample, folder.path());
  const files::CameraYaml calibration{.camera = sample.camera};
  ASSERT_TRUE(files::WriteCameraYaml(folder / "camera.yaml", calibration).ok());
  ExpectSample(Read(folder.path()), sample, {.poses = false, .depth = false, .masks = false});
  WriteText(folder / "camera.yaml", "width: 640\nheight: 480\nfx: 500\nfy: 500\ncx: 320\ncy: 240\n");
  EXPECT_THAT(ReadError(folder.path()), HasSubstr("the size is 640x480 px; the images have 48x36 px"));
}

// A JPEG file with FocalLengthIn35mmFilm (Exif 2.32, tag 0xA405).
std::string WithFocalLength(const std::string& jpeg, uint16_t focal_mm) {
  std::string exif("MM\0*\0\0\0\x08", 8);
  exif += std::string("\0\x01\x87\x69\0\x04\0\0\0\x01\0\0\0\x1a\0\0\0\0", 18);  // one entry: the Exif part is at 26
  exif += std::string("\0\x01\xa4\x05\0\x03\0\0\0\x01", 10);
  exif += {static_cast<char>(focal_mm >> 8), static_cast<char>(focal_mm & 255), '\0', '\0', '\0', '\0', '\0', '\0'};
  const std::string data = std::string("Exif\0\0", 6) + exif;
  std::string segment = "\xff\xe1";
  segment += static_cast<char>((data.size() + 2) >> 8);
  segment += static_cast<char>((data.size() + 2) & 255);
  return jpeg.substr(0, 2) + segment + data + jpeg.substr(2);
}

TEST(CalibrationGuessTest, TakesTheFocalLengthFromExif) {
  const testing_support::TemporaryFolder folder;
  std::vector<uint8_t> bytes;
  cv::imencode(".jpg", cv::Mat(300, 400, CV_8UC3, cv::Scalar::all(90)), bytes);
  const std::string jpeg(bytes.begin(), bytes.end());
  WriteText(folder / "1.jpg", WithFocalLength(jpeg, 26));
  WriteText(folder / "2.jpg", jpeg);
  EXPECT_EQ(FocalLength35mm(folder / "1.jpg"), 26);
  EXPECT_EQ(FocalLength35mm(folder / "2.jpg"), std::nullopt);
  EXPECT_EQ(FocalLength35mm(folder / "3.jpg"), std::nullopt);
  const files::Sequence sequence = Read(folder.path());
  EXPECT_NEAR(sequence.camera().fx_px, 26 * 500 / 43.2666, 1e-3);
  EXPECT_THAT(DiagnosticOf(sequence, "calibration_guessed").text,
              AllOf(HasSubstr("no calibration: focal length 300.5 px guessed from the Exif data"), HasSubstr("26 mm")));
}

TEST(FolderTest, ComparesNumbersInNames) {
  std::vector<std::string> names = {"rgb_10.png", "rgb_2.png", "a10b1", "a9b2", "rgb_02.png", "rgb_1.png"};
  std::sort(names.begin(), names.end(), NaturalLess);
  EXPECT_THAT(names, ElementsAre("a9b2", "a10b1", "rgb_1.png", "rgb_02.png", "rgb_2.png", "rgb_10.png"));
  EXPECT_EQ(LastNumber("rgb_0012_left"), 12);
  EXPECT_EQ(LastNumber("left"), std::nullopt);
}

TEST(ImportSequenceTest, TheCopyIsTheSameSequence) {
  const testing_support::TemporaryFolder folder;
  SampleRecording sample = MakeSample();
  sample.classes = {{1, "obj_1"}, {2, "obj_2"}};
  WriteBopLayout(sample, folder / "bop");
  const auto counts = WriteNativeSequence(Read(folder / "bop"), folder / "native", Proceed);
  ASSERT_TRUE(counts.ok()) << counts.status();
  EXPECT_EQ(counts->frames, sample.frames.size());
  EXPECT_EQ(counts->poses, sample.frames.size());
  const absl::StatusOr<files::Sequence> native = files::Sequence::Open(folder / "native", {.use_depth = true});
  ASSERT_TRUE(native.ok()) << native.status();
  ExpectSample(*native, sample);
  EXPECT_EQ(native->world_up(), "auto");
  // Images are not encoded again.
  EXPECT_TRUE(fs::equivalent(folder / "native/rgb/000000.png", folder / "bop/rgb/000002.png"));
}

TEST(ImportSequenceTest, DepthOfDifferentScales) {
  const testing_support::TemporaryFolder folder;
  SampleRecording sample = MakeSample(2);
  sample.classes = {{1, "obj_1"}, {2, "obj_2"}};
  WriteBopLayout(sample, folder / "bop");
  const absl::StatusOr<std::string> text = files::ReadFile(folder / "bop/scene_camera.json");
  ASSERT_TRUE(text.ok());
  std::string changed = *text;
  changed.replace(changed.rfind("\"depth_scale\": 0.1"), 18, "\"depth_scale\": 1.0");
  WriteText(folder / "bop/scene_camera.json", changed);
  WriteImage(folder / "bop/depth/000007.png", sample.frames[1].depth_mm);
  ASSERT_TRUE(WriteNativeSequence(Read(folder / "bop"), folder / "native", Proceed).ok());
  ExpectSample(Read(folder / "native"), sample);
}

TEST(ImportSequenceTest, KeepsClassNamesWithCommas) {
  const testing_support::TemporaryFolder folder;
  SampleRecording sample = MakeSample(2);
  sample.classes = {{1, "cup, \"large\""}, {2, "#2"}};
  WriteMasks(sample, folder / "coco.json", testing_support::MaskLayout::kCocoRuns);
  std::string json = *files::ReadFile(folder / "coco.json");
  json.replace(json.find("cup, \"large\""), 12, "cup, \\\"large\\\"");
  WriteText(folder / "coco.json", json);
  WriteImageFolder(sample, folder / "images");
  ReadOptions options = SampleOptions();
  options.files.masks = folder / "coco.json";
  ASSERT_TRUE(WriteNativeSequence(Read(folder / "images", options), folder / "native", Proceed).ok());
  options = {};
  ExpectSample(Read(folder / "native", options), sample, {.camera = false, .poses = false, .depth = false});
}

TEST(ImportSequenceTest, RefusesAFolderWithFiles) {
  const testing_support::TemporaryFolder folder;
  WriteImageFolder(MakeSample(2), folder / "images");
  WriteText(folder / "out/notes.txt", "mine");
  const auto counts = WriteNativeSequence(Read(folder / "images"), folder / "out", Proceed);
  EXPECT_THAT(Message(counts.status()), HasSubstr("out: not an empty folder"));
  EXPECT_TRUE(fs::exists(folder / "out/notes.txt"));
}

}  // namespace romap::importers::open_recording_test
