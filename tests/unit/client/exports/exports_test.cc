// What is exported means the same to the readers of the foreign layouts, which are tested against samples made by the
// published rules. Numbers of the formats are also checked here.

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/exports/colmap.h"
#include "client/exports/kitti.h"
#include "client/exports/nerfstudio.h"
#include "client/exports/usd.h"
#include "client/files/ply.h"
#include "client/files/text_file.h"
#include "client/importers/open_recording.h"
#include "tests/support/foreign_layouts.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::exports::exports_test {

using ::testing::HasSubstr;
using ::testing::Not;

// A recording with images and masks, and other poses than its own: those of a map.
class ExportsTest : public ::testing::Test {
 protected:
  ExportsTest() {
    testing_support::WriteTransformsLayout(testing_support::MakeSample(), folder_ / "in");
    sequence_.emplace(Open(folder_ / "in"));
    for (size_t k = 0; k < sequence_->size(); k += 2) {
      const double angle = 0.2 + 0.1 * static_cast<double>(k);
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, -0.5).normalized()));
      frames_.push_back({k, {turn, Eigen::Vector3d(0.3 * static_cast<double>(k), -1, 2)}});
    }
  }
  static files::Sequence Open(const std::string& source) {
    auto sequence = importers::OpenRecording(source);
    if (!sequence.ok()) throw std::runtime_error(Message(sequence.status()));
    return *std::move(sequence);
  }
  CameraModel Distorted(LensModel lens, double k5) const {
    CameraModel camera = sequence_->camera();
    camera.lens = lens;
    camera.distortion = {0.11, -0.02, 0.003, -0.004, k5};
    return camera;
  }
  void ExpectSame(const files::Sequence& read, const CameraModel& camera) const {
    ASSERT_EQ(read.size(), frames_.size());
    EXPECT_EQ(read.camera().width_px, camera.width_px);
    EXPECT_EQ(read.camera().lens, camera.lens);
    EXPECT_NEAR(read.camera().fx_px, camera.fx_px, 1e-9);
    EXPECT_NEAR(read.camera().cx_px, camera.cx_px, 1e-9);
    for (size_t i = 0; i < 5; ++i) EXPECT_NEAR(read.camera().distortion[i], camera.distortion[i], 1e-12) << i;
    for (size_t k = 0; k < frames_.size(); ++k) {
      const FrameInput frame = read.Load(k).value();
      const SE3<Camera, Camera> difference = frame.T_world_camera->Inverse() * frames_[k].T_world_camera;
      EXPECT_LT(difference.translation().norm(), 1e-9);
      EXPECT_LT(Eigen::Quaterniond::Identity().angularDistance(difference.rotation()), 1e-7);
      EXPECT_EQ(frame.image, sequence_->Load(frames_[k].index)->image);
    }
  }

  const testing_support::TemporaryFolder folder_;
  std::optional<files::Sequence> sequence_;
  std::vector<files::PosedFrame> frames_;
  const std::vector<ColoredPoint> points_ = {{{1, 2, 3}, {10, 20, 30}}, {{-1, 0, 0.5}, {255, 0, 1}}};
};

TEST_F(ExportsTest, NerfstudioHasCamerasPosesImagesAndMasks) {
  const std::string out = folder_ / "out";
  const auto images = WritePosedImages(out, *sequence_, frames_).value();
  for (const CameraModel& camera :
       {sequence_->camera(), Distorted(LensModel::kRadialTangential, 0.5), Distorted(LensModel::kFisheye, 0)}) {
    EXPECT_OK(WriteNerfstudio(out, camera, images, points_));
    const files::Sequence read = Open(out);
    ExpectSame(read, camera);
    EXPECT_EQ(read.Load(0)->label_png, sequence_->Load(frames_[0].index)->label_png);
  }
  const files::MeshFile cloud = files::ReadPly(out + "/points.ply").value();
  ASSERT_EQ(cloud.mesh.vertices.size(), points_.size());
  for (size_t k = 0; k < points_.size(); ++k) {
    EXPECT_LT((cloud.Position(k) - points_[k].p_world).norm(), 1e-6);
    EXPECT_EQ(cloud.mesh.colors[k], points_[k].color);
  }
  // The camera looks along -z of its axes there.
  const auto json = nlohmann::json::parse(files::ReadFile(out + "/transforms.json").value());
  const Eigen::Vector3d forward = frames_[0].T_world_camera.rotation() * Eigen::Vector3d::UnitZ();
  for (int row = 0; row < 3; ++row) {
    EXPECT_NEAR(json["frames"][0]["transform_matrix"][row][2].get<double>(), -forward[row], 1e-9);
  }
}

TEST_F(ExportsTest, ColmapHasCamerasPosesImagesAndPoints) {
  const std::string out = folder_ / "out";
  const auto images = WritePosedImages(out, *sequence_, frames_).value();
  for (const CameraModel& camera :
       {sequence_->camera(), Distorted(LensModel::kRadialTangential, 0), Distorted(LensModel::kFisheye, 0)}) {
    EXPECT_OK(WriteColmap(out, camera, images, points_));
    ExpectSame(Open(out), camera);
  }
  EXPECT_THAT(files::ReadFile(out + "/sparse/0/points3D.txt").value(), HasSubstr("\n1 1 2 3 10 20 30 0\n"));
  EXPECT_OK(WriteColmap(out, Distorted(LensModel::kRadialTangential, 0.5), images, points_));
  EXPECT_THAT(files::ReadFile(out + "/sparse/0/cameras.txt").value(), HasSubstr("\n1 FULL_OPENCV "));
}

TEST_F(ExportsTest, KittiHasTheMatricesOfThePoses) {
  const SE3<World, Camera> pose(Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ())), {1, 2, 3});
  EXPECT_OK(WriteKitti(folder_ / "poses.txt", std::vector<files::StampedPose>{{0, SE3<World, Camera>()}, {1, pose}}));
  std::ifstream in(folder_ / "poses.txt");
  std::vector<double> numbers{std::istream_iterator<double>(in), {}};
  ASSERT_EQ(numbers.size(), 24u);
  const std::vector<double> expected = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1, 1, 0, 0, 2, 0, 0, 1, 3};
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(numbers[i], expected[i], 1e-8) << i;
}

TEST(UsdTest, MeshesHaveTheirPoseTheirTextureAndValidNames) {
  const testing_support::TemporaryFolder folder;
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
  mesh.colors = {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}};
  mesh.triangles = {{0, 1, 2}};
  Mesh textured = mesh;
  textured.uv = {{0, 0}, {1, 0}, {0, 1}};
  const MeshTexture none, texture{.image = "JPEG", .media_type = "image/jpeg"};
  const Sim3<World, Object> S(2, Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ())), {1, 2, 3});
  EXPECT_OK(WriteUsd(folder / "map.usda",
                     {{"1_cup", "cup \"A\"\n", &mesh, &none, S}, {"1 cup", "cup", &textured, &texture, S}}));
  const std::string text = files::ReadFile(folder / "map.usda").value();
  EXPECT_TRUE(text.starts_with("#usda 1.0\n"));
  EXPECT_THAT(text, HasSubstr("upAxis = \"Z\""));
  EXPECT_THAT(text, HasSubstr("def Mesh \"o_1_cup\" ("));
  EXPECT_THAT(text, HasSubstr("def Mesh \"o_1_cup_\" (")) << "names are unique";
  EXPECT_THAT(text, HasSubstr("string className = \"cup \\\"A\\\" \""));
  EXPECT_THAT(text, HasSubstr("int[] faceVertexIndices = [0, 1, 2]"));
  EXPECT_THAT(text, HasSubstr("color3f[] primvars:displayColor = [(1.0000, 0.0000, 0.0000), "));
  EXPECT_THAT(text, HasSubstr("primvars:st = [(0, 1), (1, 1), (0, 0)]")) << "v counts upwards";
  EXPECT_THAT(text, HasSubstr("asset inputs:file = @o_1_cup_.jpg@"));
  EXPECT_EQ(files::ReadFile(folder / "o_1_cup_.jpg").value(), "JPEG");
  // x of the object is y of the world: the first row of a matrix that multiplies row vectors.
  const size_t begin = text.find("xformOp:transform = ((");
  ASSERT_NE(begin, std::string::npos);
  std::istringstream row(text.substr(begin + std::string("xformOp:transform = ((").size()));
  double x = 0, y = 0;
  char comma = 0;
  row >> x >> comma >> y;
  EXPECT_NEAR(x, 0, 1e-12);
  EXPECT_NEAR(y, 2, 1e-12);
  EXPECT_THAT(text, HasSubstr("(1, 2, 3, 1))"));
  EXPECT_EQ(std::count(text.begin(), text.end(), '{'), std::count(text.begin(), text.end(), '}'));
}

TEST(UsdTest, ObjectsWithoutAMeshAreLeftOut) {
  const testing_support::TemporaryFolder folder;
  const Mesh mesh;
  EXPECT_OK(WriteUsd(folder / "map.usda", {{"cup", "cup", &mesh, nullptr, {}}}));
  EXPECT_THAT(files::ReadFile(folder / "map.usda").value(), Not(HasSubstr("def Mesh")));
}

}  // namespace romap::exports::exports_test
