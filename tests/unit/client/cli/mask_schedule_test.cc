#include "client/cli/mask_schedule.h"

#include <gmock/gmock.h>

namespace romap::cli::mask_schedule_test {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr int64_t kFrame_ns = 40'000'000;

FrameInput Frame(uint64_t id, bool has_masks = true) {
  FrameInput frame;
  frame.frame_id = id;
  frame.timestamp_ns = 1'000'000'000 + static_cast<int64_t>(id) * kFrame_ns;
  frame.image = "image";
  if (!has_masks) return frame;
  frame.mask_encoding = MaskEncoding::kLabelPng;
  frame.label_png = "labels " + std::to_string(id);
  frame.instances = {{.label = 3, .class_name = "mug", .score = 1, .track_id = std::nullopt}};
  return frame;
}

std::vector<uint64_t> FramesThatKeepTheirMasks(MaskSchedule schedule, uint64_t frames) {
  std::vector<uint64_t> ids;
  for (uint64_t id = 1; id <= frames; ++id) {
    FrameInput frame = Frame(id);
    schedule.Apply(frame);
    EXPECT_EQ(frame.image, "image");
    EXPECT_EQ(frame.instances.empty(), frame.mask_encoding == MaskEncoding::kNone);
    if (frame.mask_encoding != MaskEncoding::kNone) ids.push_back(id);
  }
  return ids;
}

TEST(MaskScheduleTest, LimitsTheRateOfMasks) {
  EXPECT_THAT(FramesThatKeepTheirMasks(MaskSchedule(0, 0), 4), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(FramesThatKeepTheirMasks(MaskSchedule(5, 0), 14), ElementsAre(1, 6, 11));
  EXPECT_THAT(FramesThatKeepTheirMasks(MaskSchedule(1000, 0), 4), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(FramesThatKeepTheirMasks(MaskSchedule(0.1, 0), 30), ElementsAre(1));
  EXPECT_EQ(FramesThatKeepTheirMasks(MaskSchedule(10, 0), 250).size(), 100u) << "10 s";
}

TEST(MaskScheduleTest, UsesTheNextFrameWithMasksIfAFrameHasNone) {
  MaskSchedule schedule(5, 0);
  std::vector<uint64_t> ids;
  for (uint64_t id = 1; id <= 12; ++id) {
    FrameInput frame = Frame(id, /*has_masks=*/id != 6 && id != 7);
    schedule.Apply(frame);
    if (frame.mask_encoding != MaskEncoding::kNone) ids.push_back(id);
  }
  EXPECT_THAT(ids, ElementsAre(1, 8, 11));
}

TEST(MaskScheduleTest, DelaysMasksByFrameTimestamps) {
  MaskSchedule schedule(0, 0.1);
  std::vector<std::pair<uint64_t, uint64_t>> late;  // frame of the masks, and the first frame after they were due
  for (uint64_t id = 1; id <= 5; ++id) {
    FrameInput frame = Frame(id);
    while (const auto due = schedule.TakeDueBy(frame.timestamp_ns)) {
      EXPECT_EQ(due->due_ns, Frame(due->masks.frame_id).timestamp_ns + 100'000'000);
      EXPECT_EQ(due->masks.label_png, Frame(due->masks.frame_id).label_png);
      EXPECT_EQ(due->masks.instances.size(), 1u);
      late.emplace_back(due->masks.frame_id, id);
    }
    schedule.Apply(frame);
    EXPECT_EQ(frame.mask_encoding, MaskEncoding::kNone);
    EXPECT_THAT(frame.instances, IsEmpty());
  }
  EXPECT_THAT(late, ElementsAre(std::pair(1, 4), std::pair(2, 5)));
  for (uint64_t id = 3; id <= 5; ++id) EXPECT_EQ(schedule.TakeDueBy(INT64_MAX)->masks.frame_id, id);
  EXPECT_FALSE(schedule.TakeDueBy(INT64_MAX).has_value());
}

}  // namespace romap::cli::mask_schedule_test
