#include "client/bench/true_views.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>

#include "tests/unit/client/bench/tiny_sequence.h"

namespace romap::bench::true_views_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<uint64_t> Ids(const TrueFrames& frames) {
  std::vector<uint64_t> ids;
  for (const auto& frame : frames) ids.push_back(frame->frame_id);
  return ids;
}

TEST(TrueViewsTest, SubsetsAreDisjoint) {
  const testing_support::TinySequence data;
  const files::Sequence sequence = data.Open();
  EXPECT_THAT(Ids(*LoadTrueFrames(sequence, 8, 0)), ElementsAre(1, 9, 17));
  EXPECT_THAT(Ids(*LoadTrueFrames(sequence, 8, 3)), ElementsAre(4, 12, 20));
  EXPECT_EQ(LoadTrueFrames(sequence, 8, 24).status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST(TrueViewsTest, ViewContainsTheObjectAndItsSurroundings) {
  const testing_support::TinySequence data;
  const files::Sequence sequence = data.Open();
  const TrueFrames frames = *LoadTrueFrames(sequence, 6, 0);
  for (const files::ObjectRecord& object : sequence.objects()->objects) {
    const std::vector<ObjectView> views = MakeTrueViews(frames, object, /*with_depth=*/true);
    ASSERT_EQ(views.size(), frames.size());
    for (size_t i = 0; i < views.size(); ++i) {
      const ObjectView& view = views[i];
      const Frame& frame = *frames[i];
      EXPECT_EQ(view.object.value, static_cast<uint64_t>(object.id));
      EXPECT_EQ(view.keyframe.value, frame.frame_id);
      const cv::Mat is_object = frame.labels == static_cast<int>(object.id);
      EXPECT_EQ(cv::countNonZero(view.ray_kind == static_cast<int>(RayKind::kObject)), cv::countNonZero(is_object));
      EXPECT_EQ(cv::countNonZero(view.ray_kind == static_cast<int>(RayKind::kBackground)),
                cv::countNonZero(frame.labels(view.roi_px) == 0));
      EXPECT_EQ(cv::norm(view.color_bgr, frame.image_bgr(view.roi_px), cv::NORM_INF), 0);
      EXPECT_EQ(cv::norm(view.depth_mu, frame.depth_mu(view.roi_px), cv::NORM_INF), 0);
      EXPECT_EQ(view.T_world_camera.translation(), frame.T_world_camera->translation());
      // The center of the cuboid projects into the crop, which has a margin around the mask.
      const Eigen::Vector2d center =
          view.camera.Project(view.T_world_camera.Inverse() * object.T_world_object.translation());
      EXPECT_TRUE(view.roi_px.contains(cv::Point(cvRound(center.x()), cvRound(center.y()))));
      EXPECT_GT(cv::countNonZero(view.ray_kind == static_cast<int>(RayKind::kBackground)), 0);
    }
    EXPECT_TRUE(MakeTrueView(*frames[0], object, /*with_depth=*/false)->depth_mu.empty());
  }
}

TEST(TrueViewsTest, NoViewOfAnObjectWithFewPixels) {
  const testing_support::TinySequence data;
  const files::Sequence sequence = data.Open();
  Frame frame = *LoadTrueFrames(sequence, 24, 0)->front();
  const files::ObjectRecord& object = sequence.objects()->objects.front();
  ASSERT_TRUE(MakeTrueView(frame, object, false).has_value());
  frame.labels = cv::Mat::zeros(frame.labels.size(), frame.labels.type());
  EXPECT_FALSE(MakeTrueView(frame, object, false).has_value());
}

TEST(TrueViewsTest, RejectsLabelsThatAreNotObjectIds) {
  const testing_support::TinySequence data;
  std::ofstream(data.dir() + "/detections.csv") << "# timestamp,label,class,score\n0.0,1,bottle,1\n";
  EXPECT_THAT(Message(LoadTrueFrames(data.Open(), 8, 0).status()), HasSubstr("label 1 of frame 1 has class bottle"));
}

TEST(TrueViewsTest, RequiresCuboids) {
  const testing_support::TinySequence data;
  std::filesystem::remove(data.dir() + "/objects.yaml");
  EXPECT_THAT(Message(LoadTrueFrames(data.Open(), 8, 0).status()), HasSubstr("objects.yaml"));
}

}  // namespace romap::bench::true_views_test
