// Recordings whose poses are in another convention, world, unit or clock. Each must give the map of the sound sequence,
// or say what is wrong and map no object.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <utility>

#include "client/files/camera_yaml.h"
#include "tests/integration/recording_fixture.h"

namespace romap::pose_recording_test {

using recordings::kObjects;
using recordings::RunResult;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using testing_support::Recording;

class PoseRecordingTest : public recordings::RecordingTest {
 protected:
  // Diagnostics are printed on stderr when they arrive, and on stdout if they are new at the end.
  static std::string TerminalOf(const RunResult& result) { return result.process.err + result.process.out; }

  static void ExpectContradiction(const RunResult& result, const char* convention) {
    EXPECT_THAT(result.Codes(), Contains("poses_contradict_images")) << result.process.out;
    EXPECT_THAT(TerminalOf(result), HasSubstr(convention));
    EXPECT_EQ(result.objects(), 0u) << result.process.out;
  }
};

using Pose = SE3<World, Camera>;

Pose WithOpenGlAxes(const Pose& pose) { return {pose.rotation() * Eigen::Quaterniond(0, 1, 0, 0), pose.translation()}; }

TEST_F(PoseRecordingTest, TheFirstPosesAreMissing) {
  std::vector<files::StampedPose> poses = recording().Poses();
  poses.erase(poses.begin(), poses.begin() + 3);
  recording().WritePoses(poses);
  const RunResult result = Run();
  ExpectTheMap(result);
  EXPECT_THAT(result.process.out, HasSubstr("57 of 60 frames have one"));
}

TEST_F(PoseRecordingTest, TheClockOfThePosesIsAnotherOne) {
  std::vector<files::StampedPose> poses = recording().Poses();
  for (files::StampedPose& pose : poses) pose.timestamp_ns += 1'403'715'271'700'000'000;
  recording().WritePoses(poses);
  const RunResult result = Run();
  EXPECT_THAT(result.Warnings(), Contains("poses_unmatched"));
  EXPECT_THAT(result.process.err, HasSubstr("1403715271.7"));
  EXPECT_THAT(result.process.out, HasSubstr("0 of 60 frames have one"));
}

TEST_F(PoseRecordingTest, AxesOfOpenGl) {
  ChangePoses(WithOpenGlAxes);
  ExpectContradiction(Run(), "opengl");
  ExpectTheMap(Run({"--pose-convention", "opengl"}));
}

TEST_F(PoseRecordingTest, WorldToCamera) {
  ChangePoses([](const Pose& pose) {
    const SE3<Camera, World> inverse = pose.Inverse();
    return Pose{inverse.rotation(), inverse.translation()};
  });
  ExpectContradiction(Run(), "world_to_camera");
  ExpectTheMap(Run({"--pose-convention", "world_to_camera"}));
}

TEST_F(PoseRecordingTest, QuaternionsWithWFirst) {
  ChangePoses([](const Pose& pose) {
    const Eigen::Quaterniond& q = pose.rotation();
    return Pose{Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()), pose.translation()};
  });
  ExpectContradiction(Run(), "wxyz");
  ExpectTheMap(Run({"--pose-convention", "wxyz"}));
}

TEST_F(PoseRecordingTest, TheFocalLengthIsThatOfAnotherImageSize) {
  const std::string camera = recording().Read("camera.yaml");
  for (const char* key : {"fx", "fy"}) {
    const double focal_px = std::stod(camera.substr(camera.find(std::string(key) + ": ") + 4));
    recording().Replace("camera.yaml", std::string("^") + key + ": (\\S+)", fmt::format("{}: {}", key, 1.5 * focal_px));
  }
  const RunResult result = Run();
  EXPECT_THAT(result.Codes(), Contains("calibration_contradicts_images")) << result.process.out;
  EXPECT_EQ(result.objects(), 0u) << result.process.out;
}

TEST_F(PoseRecordingTest, TimestampsInNanoseconds) {
  std::string text;
  for (const files::StampedPose& pose : recording().Poses()) {
    const Eigen::Quaterniond& q = pose.T_world_camera.rotation();
    const Eigen::Vector3d& t = pose.T_world_camera.translation();
    text +=
        fmt::format("{} {} {} {} {} {} {} {}\n", pose.timestamp_ns, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  recording().Write("groundtruth.txt", text);
  const RunResult result = Run();
  ExpectTheMap(result);
  EXPECT_THAT(result.Codes(), Contains("timestamps_converted"));
}

TEST_F(PoseRecordingTest, YIsUp) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(-0.5 * EIGEN_PI, Eigen::Vector3d::UnitX()));
  ChangePoses([&](const Pose& pose) { return Pose{turn * pose.rotation(), turn * pose.translation()}; });
  recording().Remove("objects.yaml");
  EXPECT_THAT(TerminalOf(Run()), HasSubstr("run with --up y"));
  const RunResult result = Run({"--up", "y"});
  EXPECT_THAT(result.Codes(), Not(Contains("up_contradicts_images")));
  ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
  EXPECT_EQ(result.objects(), static_cast<size_t>(kObjects)) << result.process.out;
  const auto up = result.cuboids["objects"][0]["T_world_object"];
  EXPECT_NEAR(up[6].get<double>(), 1, 1e-3) << "the z axis of the cuboid is the y axis of the world: " << up.dump();
}

TEST_F(PoseRecordingTest, FarFromTheOrigin) {
  ChangePoses([](const Pose& pose) {
    return Pose{pose.rotation(), Eigen::Vector3d(pose.translation() + Eigen::Vector3d(500000, 400000, 100))};
  });
  recording().Remove("objects.yaml");
  const RunResult result = RunTrained();
  ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
  EXPECT_EQ(result.objects(), static_cast<size_t>(kObjects)) << result.process.out;
  EXPECT_GT(result.DistinctX(), 1000u);
}

TEST_F(PoseRecordingTest, PosesInKilometers) {
  ChangePoses([](const Pose& pose) { return Pose{pose.rotation(), Eigen::Vector3d(0.001 * pose.translation())}; });
  recording().Remove("objects.yaml");
  const RunResult result = Run();
  ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
  EXPECT_EQ(result.objects(), static_cast<size_t>(kObjects)) << result.process.out;
  EXPECT_THAT(result.process.out, Not(HasSubstr("0.000 x 0.000")));
}

TEST_F(PoseRecordingTest, TooFewFramesForObjects) {
  const std::string list = recording().Read("rgb.txt");
  size_t end = 0;
  for (int line = 0; line < 6; ++line) end = list.find('\n', end) + 1;
  recording().Write("rgb.txt", list.substr(0, end));
  const RunResult result = Run();
  ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
  EXPECT_EQ(result.objects(), 0u);
  EXPECT_THAT(result.Codes(), Contains("no_object_confirmed")) << result.process.out;
}

TEST_F(PoseRecordingTest, DepthInAnotherUnit) {
  recording().Replace("camera.yaml", "depth_scale: (\\S+)", "depth_scale: 2e-5");
  const RunResult result = Run({"--depth"});
  ExpectTheMap(result);
  EXPECT_THAT(result.Codes(), Contains("depth_contradicts_images"));
}

TEST_F(PoseRecordingTest, DepthAlongTheRays) {
  const CameraModel camera = files::ReadCameraYaml(recording().Path("camera.yaml"))->camera;
  recording().ChangeImages("depth", [&](cv::Mat depth, size_t) {
    for (int v = 0; v < depth.rows; ++v) {
      for (int u = 0; u < depth.cols; ++u) {
        auto& value = depth.at<uint16_t>(v, u);
        value = cv::saturate_cast<uint16_t>(value * camera.Unproject(u, v).norm());
      }
    }
    return depth;
  });
  const RunResult result = Run({"--depth"});
  ExpectTheMap(result);
  EXPECT_THAT(result.Codes(), Contains("depth_contradicts_images"));
  EXPECT_THAT(TerminalOf(result), HasSubstr("along the viewing rays"));
}

TEST_F(PoseRecordingTest, FlippedImages) {
  for (const auto& [code, what] : {std::pair(1, "mirrored left to right"), std::pair(0, "mirrored top to bottom"),
                                   std::pair(-1, "turned by 180 degrees")}) {
    const testing_support::Recording flipped(recording().dir(), folder() / fmt::format("flipped{}", code));
    for (const char* kind : {"rgb", "mask"}) {
      flipped.ChangeImages(kind, [&](const cv::Mat& image, size_t) {
        cv::Mat changed;
        cv::flip(image, changed, code);
        return changed;
      });
    }
    const RunResult result = RunOn(flipped.dir(), {"--max-training", "1"});
    EXPECT_EQ(result.objects(), 0u) << what;
    EXPECT_THAT(result.Codes(), Contains("poses_contradict_images")) << what;
    EXPECT_THAT(TerminalOf(result), HasSubstr(what));
  }
}

TEST_F(PoseRecordingTest, ADistortionThatTheImagesDoNotHave) {
  recording().Replace("camera.yaml", "^distortion:.*$", "distortion: [-0.4, 0, 0, 0, 0]");
  const RunResult result = Run();
  EXPECT_THAT(result.Codes(), Contains("calibration_contradicts_images"));
  EXPECT_THAT(TerminalOf(result), HasSubstr("without distortion"));
}

}  // namespace romap::pose_recording_test
