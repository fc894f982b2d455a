#include "server/session/live_view.h"

#include <gmock/gmock.h>

#include "common/color_image.h"
#include "tests/support/streams.h"

namespace romap::session::live_view_test {

std::shared_ptr<const Frame> FrameOf(uint64_t frame_id, cv::Size size, const cv::Scalar& color_bgr) {
  auto frame = std::make_shared<Frame>();
  frame->frame_id = frame_id;
  frame->image_bgr = cv::Mat(size, CV_8UC3, color_bgr);
  return frame;
}

TEST(LiveViewTest, SendsTheNewestImageScaled) {
  LiveView view;
  EXPECT_CODE(view.Image(640).status(), absl::StatusCode::kNotFound);
  view.SetImage(FrameOf(1, {640, 480}, {0, 0, 255}));
  view.SetImage(FrameOf(2, {1200, 800}, {255, 0, 0}));
  const CameraImage image = view.Image(600).value();
  EXPECT_EQ(image.frame_id, 2u);
  SampleRange range;
  const cv::Mat decoded = DecodeColor(image.jpeg, &range).value();
  EXPECT_EQ(decoded.size(), cv::Size(600, 400));
  EXPECT_NEAR(decoded.at<cv::Vec3b>(200, 300)[0], 255, 3) << "blue";
  view.SetImage(FrameOf(3, {100, 300}, {0, 0, 0}));
  EXPECT_EQ(DecodeColor(view.Image(600)->jpeg, &range)->size(), cv::Size(100, 300)) << "small images stay as they are";
}

TEST(LiveViewTest, PointsGetARevision) {
  LiveView view;
  EXPECT_EQ(view.Points().revision, 0u);
  view.SetPoints({.map_id = SparseMapId{1}, .positions_world = {{1, 2, 3}}});
  view.SetPoints({.map_id = SparseMapId{2}, .positions_world = {{1, 2, 3}, {4, 5, 6}}});
  EXPECT_EQ(view.Points().revision, 2u);
  EXPECT_EQ(view.Points().map_id, SparseMapId{2});
  EXPECT_THAT(view.Points().positions_world, ::testing::SizeIs(2));
}

}  // namespace romap::session::live_view_test
