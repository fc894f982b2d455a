#include "server/slam/mask_zones.h"

#include <gtest/gtest.h>

namespace romap::slam::mask_zones_test {

constexpr uint16_t kLabel = 3;

// A mask over the columns 200..299 of a wide image.
cv::Mat Labels() {
  cv::Mat labels(480, 640, CV_16UC1, cv::Scalar(0));
  labels(cv::Rect(200, 100, 100, 300)).setTo(kLabel);
  return labels;
}

TEST(MaskZones, ZonesAreUnknownWithoutMasks) {
  EXPECT_EQ(MaskZones({}).At({10, 10}, 1, 0), MaskZone::kUnknown);
  EXPECT_EQ(MaskZones(cv::Mat(480, 640, CV_16UC1, cv::Scalar(0))).At({10, 10}, 1, 0), MaskZone::kFar);
}

TEST(MaskZones, DistinguishesInsideBorderNearAndFar) {
  const MaskZones zones(Labels());
  EXPECT_EQ(zones.At({250, 200}, 1, kLabel), MaskZone::kInside);
  EXPECT_EQ(zones.At({299, 200}, 1, 0), MaskZone::kBorder);  // inside, but too close to the border to have a label
  EXPECT_EQ(zones.At({301, 200}, 1, 0), MaskZone::kBorder);
  EXPECT_EQ(zones.At({320, 200}, 1, 0), MaskZone::kNear);
  EXPECT_EQ(zones.At({500, 200}, 1, 0), MaskZone::kFar);
}

TEST(MaskZones, CoarseFeaturesHaveAWideBorder) {
  const MaskZones zones(Labels());
  EXPECT_EQ(zones.At({306, 200}, 1, 0), MaskZone::kNear);
  EXPECT_EQ(zones.At({306, 200}, 3.5, 0), MaskZone::kBorder);
}

TEST(MaskZones, HandlesPixelsOutsideTheImage) {
  cv::Mat labels(9, 11, CV_16UC1, cv::Scalar(kLabel));
  const MaskZones zones(labels);
  EXPECT_EQ(zones.At({0, 0}, 3.5, 0), MaskZone::kBorder);
  EXPECT_EQ(zones.At({10, 8}, 1, 0), MaskZone::kBorder);
  EXPECT_EQ(zones.At({-100, 1000}, 1, 0), MaskZone::kNear);
}

TEST(MaskVotes, IgnoresUnknownZones) {
  MaskVotes votes;
  for (const MaskZone zone : {MaskZone::kUnknown, MaskZone::kInside, MaskZone::kInside, MaskZone::kNear}) {
    votes.Add(zone);
  }
  MaskVotes more;
  more.Add(MaskZone::kBorder);
  more.Add(MaskZone::kFar);
  votes.Add(more);
  EXPECT_EQ(votes.inside, 2);
  EXPECT_EQ(votes.near, 1);
  EXPECT_EQ(votes.border, 1);
  EXPECT_EQ(votes.far, 1);
  EXPECT_EQ(votes.total(), 5);
}

}  // namespace romap::slam::mask_zones_test
