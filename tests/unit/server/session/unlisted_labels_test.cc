#include "server/session/unlisted_labels.h"

#include <gmock/gmock.h>

namespace romap::session::unlisted_labels_test {

using ::testing::HasSubstr;

// A mask with one pixel of each label.
cv::Mat Mask(const std::vector<int>& values) {
  cv::Mat labels(2, 8, CV_16UC1, cv::Scalar(0));
  for (size_t k = 0; k < values.size(); ++k)
    labels.at<uint16_t>(1, static_cast<int>(k)) = static_cast<uint16_t>(values[k]);
  return labels;
}

std::vector<Instance> Listed(const std::vector<uint32_t>& values) {
  std::vector<Instance> instances;
  for (const uint32_t label : values)
    instances.push_back({.label = label, .class_name = "cup", .score = 1, .track_id = {}});
  return instances;
}

TEST(UnlistedLabelsTest, EveryLabelGetsAnInstance) {
  UnlistedLabels labels;
  std::vector<Instance> instances = Listed({2});
  labels.Add(1, /*eight_bit=*/true, Mask({2, 7}), &instances);
  ASSERT_EQ(instances.size(), 2u);
  EXPECT_EQ(instances[1].label, 7u);
  EXPECT_EQ(instances[1].class_name, "object");
}

TEST(UnlistedLabelsTest, SaysWhichLabelHasNoClass) {
  UnlistedLabels labels;
  for (uint64_t frame = 1; frame <= 4; ++frame) {
    std::vector<Instance> instances = Listed({1});
    labels.Add(frame, /*eight_bit=*/true, Mask({frame == 1 ? 1 : 255}), &instances);
  }
  const std::optional<Diagnostic> diagnostic = labels.Check();
  ASSERT_TRUE(diagnostic.has_value());
  EXPECT_EQ(diagnostic->code, "labels_without_class");
  EXPECT_EQ(diagnostic->severity, Severity::kWarning);
  EXPECT_EQ(diagnostic->first_frame_id, 2u);
  EXPECT_EQ(diagnostic->count, 3u);
  EXPECT_THAT(diagnostic->text, HasSubstr("label 255 in frame 2, where the listed label 1 has no pixel"));
}

TEST(UnlistedLabelsTest, AFewMasksAreNoWarning) {
  UnlistedLabels labels;
  for (uint64_t frame = 1; frame <= 4; ++frame) {
    std::vector<Instance> instances = Listed({1});
    labels.Add(frame, /*eight_bit=*/true, frame == 1 ? Mask({1, 2}) : Mask({1}), &instances);
  }
  ASSERT_TRUE(labels.Check().has_value());
  EXPECT_EQ(labels.Check()->severity, Severity::kInfo);
}

TEST(UnlistedLabelsTest, ClientsWithoutClassesAndIgnoredPixelsAreSound) {
  UnlistedLabels without_classes;
  std::vector<Instance> none;
  without_classes.Add(1, /*eight_bit=*/true, Mask({1, 2}), &none);
  EXPECT_FALSE(without_classes.Check().has_value());
  UnlistedLabels with_void;
  std::vector<Instance> instances = Listed({1});
  with_void.Add(1, /*eight_bit=*/true, Mask({1, 255}), &instances);
  instances = Listed({1});
  with_void.Add(2, /*eight_bit=*/false, Mask({1, 65535}), &instances);
  EXPECT_FALSE(with_void.Check().has_value());
}

}  // namespace romap::session::unlisted_labels_test
