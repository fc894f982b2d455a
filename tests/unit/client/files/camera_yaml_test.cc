#include "client/files/camera_yaml.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace romap::files::camera_yaml_test {

using ::testing::HasSubstr;

std::string TempPath(const std::string& name) {
  return testing::TempDir() + "romap_" + testing::UnitTest::GetInstance()->current_test_info()->name() + "_" + name;
}

std::string ErrorOf(const absl::Status& status) { return std::string(status.message()); }

TEST(CameraYamlTest, RoundTrip) {
  const std::string path = TempPath("camera.yaml");
  CameraYaml camera;
  camera.camera = {640, 480, 888.888916015625, 525.7, 319.5, 239.5, {-0.1, 0.02, 1e-4, -2e-4, 3e-3}};
  camera.camera.readout_s = 0.0237;
  camera.fps = 29.97;
  camera.depth_scale = 4.5777065690089265e-05;
  ASSERT_TRUE(WriteCameraYaml(path, camera).ok());
  const auto read = ReadCameraYaml(path);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->camera, camera.camera);
  EXPECT_EQ(read->fps, camera.fps);
  EXPECT_EQ(read->depth_scale, camera.depth_scale);
  std::filesystem::remove(path);
}

TEST(CameraYamlTest, RoundTripOfAFisheyeCamera) {
  const std::string path = TempPath("camera.yaml");
  CameraYaml camera;
  camera.camera = {640, 480, 300, 301, 319.5, 239.5, {-0.01, 0.02, 1e-4, -2e-4, 0}, LensModel::kFisheye};
  ASSERT_TRUE(WriteCameraYaml(path, camera).ok());
  const auto read = ReadCameraYaml(path);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->camera, camera.camera);
  std::filesystem::remove(path);
}

TEST(CameraYamlTest, NamesTheError) {
  const std::string path = TempPath("camera.yaml");
  const std::string good = "width: 64\nheight: 48\nfx: 50\nfy: 50\ncx: 31.5\ncy: 23.5\n";
  for (const auto& [text, message] : std::vector<std::pair<std::string, std::string>>{
           {"width: 64\nheight: 48\nfy: 50\n", "'fx' is missing"},
           {good + "fx: [1\n", "invalid YAML"},
           {"just words\n", "expected a YAML map"},
           {"width: 64.5\nheight: 48\n", "'width' is 64.5; expected a positive integer"},
           {"width: 64\nheight: .nan\n", "camera.yaml:2: 'height' is not a finite number"},
           {good + "distortion: [0, 0, 0]\n", "camera.yaml:7: expected 'distortion' to be a list of 5 numbers"},
           {good + "lens: fisheye\ndistortion: [0, 0, 0, 0, 0]\n",
            "camera.yaml:8: expected 'distortion' to be a list of 4 numbers"},
           {good + "lens: wide\n", "camera.yaml:7: 'lens' is 'wide'; expected radial-tangential or fisheye"},
           {good + "readout_s: 23.7\n", "readout time must be in 0..1 s, is 23.7 s"},
           {good + "fps: 0\n", "'fps' is 0; expected a positive number"}}) {
    std::ofstream(path) << text;
    EXPECT_THAT(ErrorOf(ReadCameraYaml(path).status()), HasSubstr(message));
  }
  std::filesystem::remove(path);
  EXPECT_EQ(ReadCameraYaml(path).status().code(), absl::StatusCode::kNotFound);
}

}  // namespace romap::files::camera_yaml_test
