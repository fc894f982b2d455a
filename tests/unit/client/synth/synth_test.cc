#include "client/synth/synth.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "client/files/ply.h"
#include "client/files/sequence.h"
#include "client/files/text_file.h"

namespace romap::synth::synth_test {

namespace fs = std::filesystem;

// Each test has a temporary folder.
class MakeSequenceTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    dir_ = fs::path(::testing::TempDir()) / (std::string("romap_synth_") + info->name());
    fs::remove_all(dir_);
    fs::create_directories(dir_);
  }
  void TearDown() override { fs::remove_all(dir_); }

  std::string Dir(const std::string& name = "sequence") const { return dir_ / name; }

  // Few small frames; most of the time is for the scene.
  static SynthOptions Small() { return {.seed = 3, .objects = 2, .frames = 4, .width_px = 160, .height_px = 120}; }

  static cv::Mat Read(const std::string& path) { return cv::imread(path, cv::IMREAD_UNCHANGED); }

  fs::path dir_;
};

using Files = std::map<std::string, std::string>;

Files AllFiles(const std::string& dir) {
  Files files;
  for (const auto& entry : fs::recursive_directory_iterator(dir)) {
    if (!entry.is_regular_file()) continue;
    files[fs::relative(entry.path(), dir)] = files::ReadFile(entry.path()).value();
  }
  return files;
}

TEST_F(MakeSequenceTest, IsReadableAsASequence) {
  int last_done = 0;
  ASSERT_TRUE(MakeSequence(Small(), Dir(), [&](int done, int total) {
                EXPECT_EQ(done, last_done + 1);
                EXPECT_EQ(total, 4);
                last_done = done;
              }).ok());
  EXPECT_EQ(last_done, 4);
  const auto sequence = files::Sequence::Open(Dir(), {.use_depth = true});
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  ASSERT_EQ(sequence->size(), 4U);
  EXPECT_EQ(sequence->camera().width_px, 160);
  EXPECT_EQ(sequence->timestamp_ns(3), 120000000);
  ASSERT_TRUE(sequence->objects().has_value());
  EXPECT_EQ(sequence->objects()->objects.size(), 2U);
  const auto frame = sequence->Load(2);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->instances.size(), 2U);
  EXPECT_TRUE(frame->T_world_camera.has_value());
  EXPECT_FALSE(frame->depth.empty());
  EXPECT_EQ(Read(Dir() + "/rgb/000001.png").size(), cv::Size(160, 120));
}

// Projects the points of the true surfaces to the frames.
TEST_F(MakeSequenceTest, TruthAgreesWithMasksAndDepth) {
  ASSERT_TRUE(MakeSequence(Small(), Dir()).ok());
  const auto sequence = files::Sequence::Open(Dir(), {.use_depth = true});
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  const CameraModel& camera = sequence->camera();
  for (const files::ObjectRecord& object : sequence->objects()->objects) {
    const auto cloud = files::ReadPly(Dir() + "/gt/" + object.name + ".ply");
    ASSERT_TRUE(cloud.ok()) << cloud.status();
    const std::vector<double>& seen = cloud->scalars.at("seen");
    const std::vector<double>& source = cloud->scalars.at("source");
    std::vector<bool> matched(seen.size());
    int in_free_space = 0;
    for (size_t i = 0; i < sequence->size(); ++i) {
      const SE3<Camera, World> T_camera_world = sequence->Load(i)->T_world_camera->Inverse();
      const cv::Mat mask = Read(fmt::format("{}/mask/{:06d}.png", Dir(), i + 1));
      const cv::Mat depth = Read(fmt::format("{}/depth/{:06d}.png", Dir(), i + 1));
      ASSERT_EQ(mask.type(), CV_8UC1);
      ASSERT_EQ(depth.type(), CV_16UC1);
      for (size_t k = 0; k < seen.size(); ++k) {
        const Eigen::Vector3d p = T_camera_world * cloud->mesh.vertices[k].cast<double>();
        const Eigen::Vector2d pixel = camera.Project(p);
        const int u = static_cast<int>(std::lround(pixel.x()));
        const int v = static_cast<int>(std::lround(pixel.y()));
        if (u < 0 || v < 0 || u >= camera.width_px || v >= camera.height_px) continue;
        const double z_m = depth.at<uint16_t>(v, u) * sequence->depth_scale();
        if (mask.at<uint8_t>(v, u) == object.id && std::abs(z_m - p.z()) < 0.006) matched[k] = true;
        double nearest_m = 1e9;
        for (int near_v = std::max(v - 1, 0); near_v <= std::min(v + 1, camera.height_px - 1); ++near_v) {
          for (int near_u = std::max(u - 1, 0); near_u <= std::min(u + 1, camera.width_px - 1); ++near_u) {
            nearest_m = std::min(nearest_m, depth.at<uint16_t>(near_v, near_u) * sequence->depth_scale());
          }
        }
        // No true point may be in front of the rendered depth.
        in_free_space += nearest_m - p.z() > 0.005 ? 1 : 0;
      }
    }
    size_t seen_count = 0;
    for (size_t k = 0; k < seen.size(); ++k) {
      if (seen[k] > 0) {
        ++seen_count;
        ASSERT_TRUE(matched[k]) << object.name << " point " << k << " is marked as seen, but not visible in any frame";
        ASSERT_EQ(source[k], 0) << "the underside cannot be seen";
      }
    }
    EXPECT_GT(seen_count, seen.size() / 10) << object.name;
    EXPECT_LT(seen_count, seen.size()) << object.name << ": four similar views cannot show everything";
    // Thin parts are below this coarse resolution.
    EXPECT_LT(in_free_space, static_cast<int>(seen.size() / 20)) << object.name;
    EXPECT_GT(std::count(source.begin(), source.end(), 2), 0) << object.name << " has an underside";
  }
}

TEST_F(MakeSequenceTest, CloudsAreOnTheMeshesAndFillTheCuboids) {
  ASSERT_TRUE(MakeSequence(Small(), Dir()).ok());
  const auto objects = files::ReadObjects(Dir() + "/objects.yaml");
  ASSERT_TRUE(objects.ok()) << objects.status();
  for (const files::ObjectRecord& object : objects->objects) {
    const auto mesh = files::ReadPly(Dir() + "/gt_mesh/" + object.name + ".ply");
    const auto cloud = files::ReadPly(Dir() + "/gt/" + object.name + ".ply");
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    ASSERT_TRUE(cloud.ok()) << cloud.status();
    EXPECT_FALSE(mesh->mesh.triangles.empty());
    const auto bounds_of = [&](const Mesh& m) {
      Eigen::AlignedBox3d bounds;
      for (const Eigen::Vector3f& p : m.vertices) bounds.extend(object.T_world_object.Inverse() * p.cast<double>());
      return bounds;
    };
    const Eigen::AlignedBox3d exact = bounds_of(mesh->mesh);
    EXPECT_LT((exact.max() - object.half_extents).norm(), 1e-5) << object.name;
    EXPECT_LT((exact.min() + object.half_extents).norm(), 1e-5) << object.name;
    const Eigen::AlignedBox3d sampled = bounds_of(cloud->mesh);
    EXPECT_LT((exact.max() - sampled.max()).cwiseAbs().maxCoeff(), 0.004) << object.name;
    EXPECT_TRUE((sampled.max().array() <= exact.max().array() + 1e-5).all()) << object.name;
    EXPECT_LE(cloud->mesh.vertices.size(), 60500U);
    EXPECT_GE(cloud->mesh.vertices.size(), 3000U);
  }
}

TEST_F(MakeSequenceTest, IsIdenticalForOneAndFourThreads) {
  SynthOptions options = Small();
  options.frames = 2;
  options.path = PathKind::kHandheld;
  options.mask_jitter_px = 2;
  options.noise_sigma = 3;
  options.permute_labels = true;
  for (const auto& [name, threads] : {std::pair{"one", size_t{1}}, std::pair{"four", size_t{4}}}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    ASSERT_TRUE(MakeSequence(options, Dir(name)).ok());
  }
  const Files one = AllFiles(Dir("one"));
  const Files four = AllFiles(Dir("four"));
  ASSERT_EQ(one.size(), four.size());
  for (const auto& [name, bytes] : one) EXPECT_TRUE(four.at(name) == bytes) << name << " differs";
}

TEST_F(MakeSequenceTest, FaultsAppearInMasksAndTables) {
  SynthOptions options = Small();
  options.frames = 8;
  options.width_px = 64;
  options.height_px = 48;
  options.permute_labels = true;
  options.mask_drop_share = 0.4;
  options.format = ImageFormat::kJpeg;
  ASSERT_TRUE(MakeSequence(options, Dir()).ok());
  EXPECT_TRUE(fs::exists(Dir() + "/rgb/000008.jpg"));
  const auto sequence = files::Sequence::Open(Dir());
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  std::map<uint32_t, std::set<std::string>> classes_of_label;
  size_t instances = 0;
  for (size_t i = 0; i < sequence->size(); ++i) {
    const cv::Mat mask = Read(fmt::format("{}/mask/{:06d}.png", Dir(), i + 1));
    const auto frame = sequence->Load(i);
    ASSERT_TRUE(frame.ok()) << frame.status();
    std::set<int> labels(mask.begin<uint8_t>(), mask.end<uint8_t>());
    labels.erase(0);
    EXPECT_EQ(labels.size(), frame->instances.size());
    instances += frame->instances.size();
    for (const Instance& instance : frame->instances) {
      EXPECT_TRUE(labels.contains(static_cast<int>(instance.label)));
      classes_of_label[instance.label].insert(instance.class_name);
    }
  }
  EXPECT_LT(instances, 16U) << "some were dropped";
  EXPECT_GT(instances, 3U);
  EXPECT_EQ(classes_of_label[1].size(), 2U) << "label 1 has different classes in different frames";
}

TEST_F(MakeSequenceTest, OmitsCutFramesAndListsRepeatedImagesAgain) {
  SynthOptions options = Small();
  options.frames = 8;
  options.width_px = 64;
  options.height_px = 48;
  options.cuts = {{3, 4}};
  options.black = {{8, 8}};
  options.duplicate_share = 1;
  ASSERT_TRUE(MakeSequence(options, Dir()).ok());
  const auto sequence = files::Sequence::Open(Dir(), {.use_depth = true});
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  ASSERT_EQ(sequence->size(), 6U);
  EXPECT_EQ(sequence->timestamp_ns(1), 40000000);
  EXPECT_EQ(sequence->timestamp_ns(2), 160000000) << "timestamps include the cut";
  EXPECT_FALSE(fs::exists(Dir() + "/rgb/000003.png"));
  // 1 1 - - 5 5 5 8: each image repeats until the next range.
  const auto first = sequence->Load(0);
  const auto repeated = sequence->Load(1);
  const auto after_cut = sequence->Load(2);
  ASSERT_TRUE(first.ok() && repeated.ok() && after_cut.ok());
  EXPECT_TRUE(first->image == repeated->image);
  EXPECT_EQ(first->instances.size(), repeated->instances.size());
  EXPECT_EQ(first->T_world_camera->translation(), repeated->T_world_camera->translation());
  EXPECT_FALSE(first->image == after_cut->image);
  const auto black = sequence->Load(5);
  ASSERT_TRUE(black.ok()) << black.status();
  EXPECT_TRUE(black->instances.empty());
  EXPECT_EQ(cv::countNonZero(Read(Dir() + "/rgb/000008.png").reshape(1)), 0);
  EXPECT_EQ(cv::countNonZero(Read(Dir() + "/depth/000008.png")), 0);
}

TEST_F(MakeSequenceTest, NamesInvalidOptions) {
  SynthOptions options;
  options.objects = 17;
  options.fps = NAN;
  options.mask_drop_share = 1.5;
  const absl::Status status = MakeSequence(options, Dir());
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  for (const char* name : {"objects is 17", "fps", "mask_drop_share"}) {
    EXPECT_NE(Message(status).find(name), std::string::npos) << status;
  }
  EXPECT_EQ(Message(status).find("frames"), std::string::npos) << status;
  EXPECT_FALSE(fs::exists(Dir())) << "no files are written";

  SynthOptions ranges;
  ranges.cuts = {{5, 2}};
  ranges.black = {{0, 3}};
  ranges.blurred = {{290, 301}};
  for (const char* name : {"cut is 5:2", "black is 0:3", "blurred is 290:301", "1:300"}) {
    EXPECT_NE(Message(ValidateSynthOptions(ranges)).find(name), std::string::npos) << name;
  }
  SynthOptions nothing;
  nothing.cuts = {{1, 200}, {150, 300}};
  EXPECT_EQ(Message(ValidateSynthOptions(nothing)), "synthetic sequence: cut removes all frames");

  SynthOptions twins;
  twins.objects = 3;
  twins.identical_pairs = 2;
  EXPECT_NE(Message(ValidateSynthOptions(twins)).find("identical_pairs"), std::string::npos);
}

TEST_F(MakeSequenceTest, BlackBackgroundShowsOnlyObjects) {
  SynthOptions options = Small();
  options.frames = 1;
  options.surroundings.background = Background::kBlack;
  ASSERT_TRUE(MakeSequence(options, Dir()).ok());
  const cv::Mat color = Read(Dir() + "/rgb/000001.png");
  cv::Mat near_object;
  cv::dilate(Read(Dir() + "/mask/000001.png") > 0, near_object, cv::Mat());
  cv::Mat visible;
  cv::cvtColor(color, visible, cv::COLOR_BGR2GRAY);
  EXPECT_GT(cv::countNonZero(visible), 1000);
  EXPECT_EQ(cv::countNonZero((visible > 0) & ~near_object), 0);
}

TEST_F(MakeSequenceTest, RollingShutterAndCropAgreeWithTheGroundTruth) {
  SynthOptions options = Small();
  options.shake_deg = 4;
  options.readout = 0.8;
  options.exposure = 0.3;
  options.fx_px = 170;
  options.fy_px = 150;
  options.crop = {.x_px = 20, .y_px = 10, .width_px = 120, .height_px = 100};
  ASSERT_TRUE(MakeSequence(options, Dir()).ok());
  const auto sequence = files::Sequence::Open(Dir(), {.use_depth = true});
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  EXPECT_EQ(sequence->camera().width_px, 120);
  EXPECT_EQ(sequence->camera().fx_px, 170);
  EXPECT_EQ(sequence->camera().fy_px, 150);
  const cv::Mat mask = Read(Dir() + "/mask/000001.png");
  EXPECT_EQ(mask.size(), cv::Size(120, 100));
  size_t seen_points = 0;
  for (const files::ObjectRecord& object : sequence->objects()->objects) {
    const auto cloud = files::ReadPly(Dir() + "/gt/" + object.name + ".ply");
    ASSERT_TRUE(cloud.ok()) << cloud.status();
    const std::vector<double>& seen = cloud->scalars.at("seen");
    seen_points += static_cast<size_t>(std::count(seen.begin(), seen.end(), 1.0));
  }
  EXPECT_GT(seen_points, 500U) << "visibility uses the pose of each row";
}

TEST_F(MakeSequenceTest, OverlaysHideObjectsInAllImages) {
  SynthOptions options = Small();
  options.frames = 1;
  options.gripper_share = 0.5;
  ASSERT_TRUE(MakeSequence(options, Dir()).ok());
  const cv::Mat depth = Read(Dir() + "/depth/000001.png");
  const cv::Mat gripper = depth == 1500;  // 0.15 m
  EXPECT_NEAR(cv::countNonZero(gripper), 0.5 * 160 * 120, 200);
  EXPECT_EQ(cv::countNonZero(Read(Dir() + "/mask/000001.png") & gripper), 0);
}

TEST_F(MakeSequenceTest, JpegQualityChangesTheSizeOfImages) {
  SynthOptions options = Small();
  options.frames = 1;
  options.format = ImageFormat::kJpeg;
  ASSERT_TRUE(MakeSequence(options, Dir("high")).ok());
  options.jpeg_quality = 30;
  ASSERT_TRUE(MakeSequence(options, Dir("low")).ok());
  EXPECT_LT(2 * fs::file_size(Dir("low") + "/rgb/000001.jpg"), fs::file_size(Dir("high") + "/rgb/000001.jpg"));
}

TEST_F(MakeSequenceTest, ReportsAMissingParentFolder) {
  const absl::Status status = MakeSequence(Small(), Dir("missing") + "/sequence");
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_NE(Message(status).find("missing/sequence: cannot create"), std::string::npos) << status;
}

}  // namespace romap::synth::synth_test
