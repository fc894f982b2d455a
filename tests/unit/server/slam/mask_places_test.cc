#include "server/slam/mask_places.h"

#include <gtest/gtest.h>

namespace romap::slam {
namespace {

constexpr uint16_t kLabel = 3;

// A mask over the columns 200..299 of a wide image.
cv::Mat Labels() {
  cv::Mat labels(480, 640, CV_16UC1, cv::Scalar(0));
  labels(cv::Rect(200, 100, 100, 300)).setTo(kLabel);
  return labels;
}

TEST(MaskPlaces, WithoutMasksNothingIsKnown) {
  EXPECT_EQ(MaskPlaces({}).At({10, 10}, 1, 0), MaskPlace::kUnknown);
  EXPECT_EQ(MaskPlaces(cv::Mat(480, 640, CV_16UC1, cv::Scalar(0))).At({10, 10}, 1, 0), MaskPlace::kFar);
}

TEST(MaskPlaces, TellsInsideBorderNearAndFar) {
  const MaskPlaces places(Labels());
  EXPECT_EQ(places.At({250, 200}, 1, kLabel), MaskPlace::kInside);
  EXPECT_EQ(places.At({299, 200}, 1, 0), MaskPlace::kBorder);  // inside, but too close to the rim to have a label
  EXPECT_EQ(places.At({301, 200}, 1, 0), MaskPlace::kBorder);
  EXPECT_EQ(places.At({320, 200}, 1, 0), MaskPlace::kNear);
  EXPECT_EQ(places.At({500, 200}, 1, 0), MaskPlace::kFar);
}

TEST(MaskPlaces, CoarseFeaturesHaveAWideBorder) {
  const MaskPlaces places(Labels());
  EXPECT_EQ(places.At({306, 200}, 1, 0), MaskPlace::kNear);
  EXPECT_EQ(places.At({306, 200}, 3.5, 0), MaskPlace::kBorder);
}

TEST(MaskPlaces, PlacesAtAndBeyondTheImagesEdgeAreAnswered) {
  cv::Mat labels(9, 11, CV_16UC1, cv::Scalar(kLabel));
  const MaskPlaces places(labels);
  EXPECT_EQ(places.At({0, 0}, 3.5, 0), MaskPlace::kBorder);
  EXPECT_EQ(places.At({10, 8}, 1, 0), MaskPlace::kBorder);
  EXPECT_EQ(places.At({-100, 1000}, 1, 0), MaskPlace::kNear);
}

TEST(MaskVotes, CountsPlacesThatAreKnown) {
  MaskVotes votes;
  for (const MaskPlace place : {MaskPlace::kUnknown, MaskPlace::kInside, MaskPlace::kInside, MaskPlace::kNear}) {
    votes.Add(place);
  }
  MaskVotes more;
  more.Add(MaskPlace::kBorder);
  more.Add(MaskPlace::kFar);
  votes.Add(more);
  EXPECT_EQ(votes.inside, 2);
  EXPECT_EQ(votes.near, 1);
  EXPECT_EQ(votes.border, 1);
  EXPECT_EQ(votes.far, 1);
  EXPECT_EQ(votes.total(), 5);
}

}  // namespace
}  // namespace romap::slam
