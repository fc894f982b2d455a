#include "client/bench/timed_training.h"

#include <gtest/gtest.h>

#include "client/bench/true_views.h"
#include "server/nerf/object_field.h"
#include "tests/unit/client/bench/tiny_sequence.h"

namespace romap::bench::timed_training_test {

constexpr double kForever_s = 1e6;

// The views of one object and a small field.
struct TimedTrainingTest : public ::testing::Test {
  TimedTrainingTest() {
    const files::Sequence sequence = data.Open();
    object = sequence.objects()->objects.front();
    views = MakeTrueViews(*LoadTrueFrames(sequence, 4, 0), object, false);
    request.config.levels = 4;
    request.config.log2_table_entries = 10;
    request.config.rays_per_step = 128;
    request.config.full_budget_steps = 30;
    request.config.max_extra_steps = 0;
    request.cuboid = {object.T_world_object, object.half_extents, 1.0};
    request.views = &views;
    request.threads = 1;
    request.limit_s = kForever_s;
  }

  std::vector<float> RawOf(const FieldSnapshot& snapshot) const {
    std::vector<Eigen::Vector3f> points;
    for (int i = 0; i < 64; ++i) {
      const Eigen::Vector3f corner(i & 3, i >> 2 & 3, i >> 4);
      points.push_back(snapshot.box_half_extents.cwiseProduct(corner / 2 - Eigen::Vector3f::Constant(0.75)));
    }
    std::vector<float> raw(points.size());
    snapshot.field->Sample(points, raw, {});
    return raw;
  }

  testing_support::TinySequence data;
  files::ObjectRecord object;
  std::vector<ObjectView> views;
  TrainingRequest request;
  double seconds_per_step = 0;
};

TEST_F(TimedTrainingTest, TrainsTheWholePlanLikeObjectField) {
  const absl::StatusOr<TimedTraining> training = TrainWithin(request, seconds_per_step);
  ASSERT_TRUE(training.ok()) << Message(training.status());
  EXPECT_EQ(training->stats.steps, 30);
  EXPECT_EQ(training->snapshot.steps, 30u);
  EXPECT_FALSE(training->limited);
  EXPECT_GT(training->stats.samples, training->stats.rays);
  EXPECT_GT(training->train_s, 0);
  EXPECT_GT(training->setup_s, 0);
  EXPECT_DOUBLE_EQ(seconds_per_step, training->train_s / 30);
  nerf::ObjectField field(request.config, views.front().object, request.seed);
  ASSERT_TRUE(field.SetBox(request.cuboid).ok());
  for (const ObjectView& view : views) ASSERT_TRUE(field.AddView(view).ok());
  field.Train(30, 1);
  EXPECT_EQ(RawOf(training->snapshot), RawOf(field.Snapshot()));
}

// A shortened plan lets the learning rate schedule complete.
TEST_F(TimedTrainingTest, ShortensAPlanThatDoesNotFit) {
  seconds_per_step = 1;  // the estimate of an earlier training
  request.limit_s = 12.5;
  const absl::StatusOr<TimedTraining> shortened = TrainWithin(request, seconds_per_step);
  ASSERT_TRUE(shortened.ok());
  EXPECT_TRUE(shortened->limited);
  EXPECT_EQ(shortened->stats.steps, 12);
  request.config.full_budget_steps = 12;
  request.limit_s = kForever_s;
  const absl::StatusOr<TimedTraining> planned = TrainWithin(request, seconds_per_step);
  EXPECT_FALSE(planned->limited);
  EXPECT_EQ(RawOf(shortened->snapshot), RawOf(planned->snapshot));
}

TEST_F(TimedTrainingTest, RespectsTheLimitIfStepsAreSlowerThanExpected) {
  seconds_per_step = 1e-9;
  request.limit_s = 1e-7;
  const absl::StatusOr<TimedTraining> training = TrainWithin(request, seconds_per_step);
  ASSERT_TRUE(training.ok());
  EXPECT_TRUE(training->limited);
  EXPECT_LT(training->stats.steps, 30);
}

TEST_F(TimedTrainingTest, TakesSnapshotsAtTheMarks) {
  request.marks_s = {1e-9, 1e-8, kForever_s};
  const absl::StatusOr<TimedTraining> training = TrainWithin(request, seconds_per_step);
  ASSERT_TRUE(training.ok());
  ASSERT_EQ(training->at_marks.size(), 2u);
  EXPECT_LT(training->at_marks[0].steps, 30u);
  EXPECT_NE(RawOf(training->at_marks[0]), RawOf(training->snapshot));
}

TEST_F(TimedTrainingTest, StopsOnRequest) {
  int polls = 0;
  request.stop = [&] { return ++polls > 1; };
  seconds_per_step = 0.1;
  EXPECT_EQ(TrainWithin(request, seconds_per_step).status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(polls, 2);
}

TEST_F(TimedTrainingTest, RejectsAnObjectWithoutViews) {
  views.clear();
  EXPECT_EQ(TrainWithin(request, seconds_per_step).status().code(), absl::StatusCode::kFailedPrecondition);
}

}  // namespace romap::bench::timed_training_test
