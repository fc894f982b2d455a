// The readers of RGB-D data sets.

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "tests/unit/client/importers/reading.h"

namespace romap::importers::rgbd_readers_test {

using importers_testing::DiagnosticOf;
using importers_testing::Read;
using importers_testing::ReadError;
using importers_testing::SampleOptions;
using importers_testing::WithDepthInBlocks;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing_support::MakeSample;
using testing_support::SampleRecording;
using testing_support::WriteImage;
using testing_support::WriteText;
namespace fs = std::filesystem;

// Depth images are 8 ms later than color images, and poses 3 ms earlier and later.
TEST(TumReaderTest, ReadsTheBenchmark) {
  const testing_support::TemporaryFolder folder;
  const SampleRecording sample = MakeSample();
  WriteTumLayout(sample, folder.path());
  const files::Sequence sequence = Read(folder.path());
  ExpectSample(sequence, sample, {.camera = false, .masks = false});
  EXPECT_EQ(sequence.timestamp_ns(0), 1305031102175000000);
  EXPECT_THAT(DiagnosticOf(sequence, "calibration_guessed").text, HasSubstr("60 degrees"));
}

TEST(TumReaderTest, ReadsAssociations) {
  const testing_support::TemporaryFolder folder;
  const SampleRecording sample = MakeSample();
  WriteTumLayout(sample, folder.path());
  std::string lines;
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    const double time_s = 1305031102.175 + sample.frames[k].time_s;
    lines += fmt::format("{0:.6f} depth/{0:.6f}.png {1:.6f} rgb/{1:.6f}.png\n", time_s + 0.008, time_s);
  }
  WriteText(folder / "associations.txt", lines);
  fs::remove(folder / "rgb.txt");
  ExpectSample(Read(folder.path()), sample, {.camera = false, .masks = false});
}

TEST(TumReaderTest, ReadsTimesFromNames) {
  const testing_support::TemporaryFolder folder;
  const SampleRecording sample = MakeSample();
  WriteTumLayout(sample, folder.path());
  fs::remove(folder / "rgb.txt");
  fs::remove(folder / "depth.txt");
  ExpectSample(Read(folder.path()), sample, {.camera = false, .masks = false});
}

TEST(TumReaderTest, TakesTheCalibrationOfTheBenchmark) {
  const testing_support::TemporaryFolder folder;
  const auto camera_of = [&](const std::string& name) {
    WriteImage(folder / name + "/rgb/0.5.png", cv::Mat::zeros(480, 640, CV_8UC3));
    WriteText(folder / name + "/rgb.txt", "0.5 rgb/0.5.png\n");
    return Read(folder / name).camera();
  };
  EXPECT_EQ(camera_of("rgbd_dataset_freiburg2_desk").fx_px, 520.9);
  EXPECT_EQ(camera_of("rgbd_dataset_freiburg2_desk").distortion[0], 0.2312);
  EXPECT_EQ(camera_of("rgbd_dataset_freiburg3_teddy").fy_px, 539.2);
  EXPECT_EQ(camera_of("office").fx_px, 525);
  EXPECT_THAT(DiagnosticOf(Read(folder / "office"), "calibration_guessed").text, HasSubstr("525.0 px, the default"));
}

TEST(TumReaderTest, MissingImagesAreNamed) {
  const testing_support::TemporaryFolder folder;
  WriteTumLayout(MakeSample(), folder.path());
  fs::remove_all(folder / "rgb");
  EXPECT_THAT(ReadError(folder.path()),
              AllOf(HasSubstr("rgb.txt:2"), HasSubstr("1305031102.175000.png"), HasSubstr("does not exist")));
}

TEST(SevenScenesReaderTest, ReadsASequence) {
  const testing_support::TemporaryFolder folder;
  SampleRecording sample = MakeSample();
  // 585 px at a width of 640 px.
  sample.camera = {.width_px = 48, .height_px = 36, .fx_px = 43.875, .fy_px = 43.875, .cx_px = 24, .cy_px = 18};
  WriteSevenScenesLayout(sample, folder.path());
  ExpectSample(Read(folder.path()), sample, {.masks = false});
}

TEST(SevenScenesReaderTest, AMalformedPoseIsNamed) {
  const testing_support::TemporaryFolder folder;
  WriteSevenScenesLayout(MakeSample(), folder.path());
  WriteText(folder / "frame-000003.pose.txt", "1 0 0 0\n0 1 0 0\n0 0 one 0\n0 0 0 1\n");
  EXPECT_THAT(ReadError(folder.path()), HasSubstr("frame-000003.pose.txt:3: 'one' is not a number"));
  WriteText(folder / "frame-000003.pose.txt", "1 0 0 0\n0 1 0 0\n0 0 -1 0\n0 0 0 1\n");
  EXPECT_THAT(ReadError(folder.path()), AllOf(HasSubstr("frame-000003.pose.txt"), HasSubstr("they mirror")));
}

TEST(ReplicaReaderTest, ReadsAScene) {
  const testing_support::TemporaryFolder folder;
  const SampleRecording sample = MakeSample();
  WriteReplicaLayout(sample, folder / "office0");
  ExpectSample(Read(folder / "office0"), sample, {.masks = false, .colors = false, .depth_error_m = 1e-4});
}

TEST(ReplicaReaderTest, NeedsTheCameraParameters) {
  const testing_support::TemporaryFolder folder;
  WriteReplicaLayout(MakeSample(), folder / "office0");
  fs::remove(folder / "cam_params.json");
  EXPECT_THAT(ReadError(folder / "office0"), HasSubstr("office0/cam_params.json does not exist"));
}

SampleRecording VmapSample() {
  SampleRecording sample = MakeSample();
  // A field of view of 90 degrees.
  sample.camera = {.width_px = 48, .height_px = 36, .fx_px = 24, .fy_px = 24, .cx_px = 23.5, .cy_px = 17.5};
  return sample;
}

TEST(VmapReaderTest, ReadsAScene) {
  const testing_support::TemporaryFolder folder;
  const SampleRecording sample = VmapSample();
  WriteVmapLayout(sample, folder.path());
  ExpectSample(Read(folder.path()), sample, {.classes = false});
}

// Class 93 is a wall.
TEST(VmapReaderTest, WallsAreNoObjects) {
  const testing_support::TemporaryFolder folder;
  SampleRecording sample = VmapSample();
  sample.classes = {{1, "class_29"}};
  WriteVmapLayout(sample, folder.path());
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    cv::Mat classes = cv::Mat::zeros(36, 48, CV_16UC1);
    classes.setTo(29, sample.frames[k].labels == 1);
    classes.setTo(93, sample.frames[k].labels == 2);
    WriteImage(fmt::format("{}/semantic_class/semantic_class_{}.png", folder.path(), k), classes);
    sample.frames[k].labels.setTo(0, sample.frames[k].labels == 2);
  }
  ExpectSample(Read(folder.path()), sample);
}

TEST(BopReaderTest, ReadsAScene) {
  const testing_support::TemporaryFolder folder;
  SampleRecording sample = MakeSample();
  sample.classes = {{1, "obj_1"}, {2, "obj_2"}};
  WriteBopLayout(sample, folder.path());
  ExpectSample(Read(folder.path()), sample);
}

TEST(BopReaderTest, InvisibleObjectsNeedNoMask) {
  const testing_support::TemporaryFolder folder;
  SampleRecording sample = MakeSample(1);
  WriteBopLayout(sample, folder.path());
  fs::remove(folder / "mask_visib/000002_000001.png");
  EXPECT_FALSE(Read(folder.path()).Load(0).ok());
  WriteText(folder / "scene_gt_info.json", R"({"2": [{"px_count_visib": 120}, {"px_count_visib": 0}]})");
  sample.classes = {{1, "obj_1"}};
  sample.frames[0].labels.setTo(0, sample.frames[0].labels == 2);
  ExpectSample(Read(folder.path()), sample);
}

TEST(BopReaderTest, AnImageWithoutCameraIsNamed) {
  const testing_support::TemporaryFolder folder;
  WriteBopLayout(MakeSample(), folder.path());
  WriteText(folder / "scene_camera.json", "{}");
  EXPECT_THAT(ReadError(folder.path()), AllOf(HasSubstr("scene_camera.json: image 2"), HasSubstr("000002.png exists")));
}

TEST(ScanNetReaderTest, ReadsAnExport) {
  const testing_support::TemporaryFolder folder;
  const SampleRecording sample = WithDepthInBlocks(MakeSample());
  WriteScanNetLayout(sample, folder.path());
  ExpectSample(Read(folder.path()), sample, {.colors = false});
}

TEST(ScanNetReaderTest, InfinitePosesAreNone) {
  const testing_support::TemporaryFolder folder;
  WriteScanNetLayout(WithDepthInBlocks(MakeSample()), folder.path());
  WriteText(folder / "pose/4.txt",
            "-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n");
  const files::Sequence sequence = Read(folder.path());
  EXPECT_FALSE(sequence.frame(4).T_world_camera);
  EXPECT_TRUE(sequence.frame(5).T_world_camera);
  EXPECT_EQ(DiagnosticOf(sequence, "poses_partial").count, 1u);
}

TEST(ScanNetReaderTest, WallsAreNoObjects) {
  const testing_support::TemporaryFolder folder;
  SampleRecording sample = WithDepthInBlocks(MakeSample());
  sample.classes = {{1, "cup"}, {2, "wall"}};
  WriteScanNetLayout(sample, folder.path());
  sample.classes = {{1, "cup"}};
  for (testing_support::SampleFrame& frame : sample.frames) frame.labels.setTo(0, frame.labels == 2);
  ExpectSample(Read(folder.path()), sample, {.colors = false});
}

TEST(EurocReaderTest, ReadsARecording) {
  const testing_support::TemporaryFolder folder;
  SampleRecording sample = MakeSample();
  sample.camera.distortion = {-0.28, 0.07, 0.0002, 0.00002, 0};
  WriteEurocLayout(sample, folder.path());
  for (testing_support::SampleFrame& frame : sample.frames) {
    cv::Mat gray;
    cv::cvtColor(frame.color, gray, cv::COLOR_BGR2GRAY);
    cv::cvtColor(gray, frame.color, cv::COLOR_GRAY2BGR);
  }
  const files::Sequence sequence = Read(folder.path());
  ExpectSample(sequence, sample, {.depth = false, .masks = false});
  EXPECT_EQ(sequence.timestamp_ns(0), 1403636579763555584);
  ExpectSample(Read(folder / "mav0"), sample, {.depth = false, .masks = false});
}

TEST(ArkitScenesReaderTest, ReadsARecording) {
  const testing_support::TemporaryFolder folder;
  SampleRecording sample = MakeSample(11);
  WriteArkitScenesLayout(sample, folder.path());
  // The trajectory has poses for every second frame.
  for (size_t k = 1; k + 1 < sample.frames.size(); k += 2) {
    const Eigen::Matrix4d &before = sample.frames[k - 1].T_world_camera, &after = sample.frames[k + 1].T_world_camera;
    const Eigen::Quaterniond a(Eigen::Matrix3d(before.topLeftCorner<3, 3>()));
    const Eigen::Quaterniond b(Eigen::Matrix3d(after.topLeftCorner<3, 3>()));
    sample.frames[k].T_world_camera.topLeftCorner<3, 3>() = a.slerp(0.5, b).toRotationMatrix();
    sample.frames[k].T_world_camera.topRightCorner<3, 1>() =
        0.5 * (before.topRightCorner<3, 1>() + after.topRightCorner<3, 1>());
  }
  ExpectSample(Read(folder.path()), sample, {.masks = false});
}

TEST(ArkitScenesReaderTest, AMissingCameraIsNamed) {
  const testing_support::TemporaryFolder folder;
  WriteArkitScenesLayout(MakeSample(), folder.path());
  fs::remove(folder / "lowres_wide_intrinsics/41048190_3310.551.pincam");
  EXPECT_THAT(ReadError(folder.path()), HasSubstr("no .pincam file within 1 ms of"));
}

TEST(PolycamReaderTest, ReadsCorrectedAndOriginalData) {
  const SampleRecording sample = WithDepthInBlocks(MakeSample());
  for (const bool corrected : {true, false}) {
    const testing_support::TemporaryFolder folder;
    WritePolycamLayout(sample, folder.path(), corrected);
    const files::Sequence sequence = Read(folder.path());
    ExpectSample(sequence, sample, {.masks = false, .colors = false});
    EXPECT_EQ(sequence.world_up(), "y");
  }
}

TEST(PolycamReaderTest, AMissingValueIsNamed) {
  const testing_support::TemporaryFolder folder;
  WritePolycamLayout(MakeSample(1), folder.path(), true);
  WriteText(folder / "keyframes/corrected_cameras/1442008525605.json",
            R"({"fx": 50, "fy": 50, "cx": 24, "cy": 18, "width": 48, "height": 36, "t_00": 1})");
  EXPECT_THAT(ReadError(folder.path()), HasSubstr("1442008525605.json: 't_01' is missing"));
}

}  // namespace romap::importers::rgbd_readers_test
