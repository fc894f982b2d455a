#include "tests/support/mask_damage.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

namespace romap::mask_damage_test {

constexpr int64_t kFrame_ns = 40'000'000;

// Two rows of three squares of 40 px, labels 1..6: 1 and 2 touch, the others are 40 px apart.
Frame SixSquares(uint64_t frame_id) {
  Frame frame;
  frame.frame_id = frame_id;
  frame.timestamp_ns = static_cast<int64_t>(frame_id) * kFrame_ns;
  frame.has_masks = true;
  frame.labels = cv::Mat::zeros(240, 320, CV_16UC1);
  const char* const names[] = {"cup", "book", "ball", "cup", "bottle", "vase"};
  for (int i = 0; i < 6; ++i) {
    const int left_px = i == 1 ? 80 : 40 + 80 * (i % 3);
    frame.labels(cv::Rect(left_px, 40 + 80 * (i / 3), 40, 40)).setTo(i + 1);
    frame.instances.push_back(
        {.label = static_cast<uint32_t>(i + 1), .class_name = names[i], .score = 0.9, .track_id = std::nullopt});
  }
  return frame;
}

const std::vector<std::string> kClasses = {"ball", "book", "bottle", "cup", "vase"};

int Area_px(const Frame& frame, uint32_t label) { return cv::countNonZero(frame.labels == static_cast<int>(label)); }

bool SameMasks(const Frame& a, const Frame& b) {
  if (a.has_masks != b.has_masks || a.instances.size() != b.instances.size()) return false;
  for (size_t i = 0; i < a.instances.size(); ++i) {
    if (a.instances[i].label != b.instances[i].label) return false;
    if (a.instances[i].class_name != b.instances[i].class_name) return false;
  }
  return !a.has_masks || cv::countNonZero(a.labels != b.labels) == 0;
}

// Describes an inconsistency of the masks; empty if every instance has pixels and every labeled pixel has an instance.
std::string InconsistencyOf(const Frame& frame) {
  std::set<uint32_t> painted;
  for (auto it = frame.labels.begin<uint16_t>(); it != frame.labels.end<uint16_t>(); ++it) painted.insert(*it);
  painted.erase(0);
  std::set<uint32_t> listed;
  for (const Instance& instance : frame.instances) {
    if (!listed.insert(instance.label).second) return "a label is listed twice";
    if (instance.class_name.empty()) return "an instance has no class";
  }
  return painted == listed ? "" : "the labels in the image and the list differ";
}

// The first frames with damaged masks.
std::vector<std::shared_ptr<const Frame>> DamagedFrames(const MaskDamage& damage, int count) {
  MaskDamager damager(damage, kClasses);
  std::vector<std::shared_ptr<const Frame>> frames;
  for (int i = 1; i <= count; ++i) frames.push_back(damager.Damage(SixSquares(static_cast<uint64_t>(i))));
  return frames;
}

TEST(MaskDamage, ChangesNothingByDefault) {
  for (const auto& frame : DamagedFrames({}, 20)) EXPECT_TRUE(SameMasks(*frame, SixSquares(frame->frame_id)));
}

TEST(MaskDamage, DoesNotModifyItsInput) {
  const Frame frame = SixSquares(1);
  MaskDamager damager({.drop_share = 1, .permute_labels = true}, kClasses);
  damager.Damage(frame);
  EXPECT_TRUE(SameMasks(frame, SixSquares(1)));
}

// All faults at the same time, each weak enough not to hide the others.
MaskDamage AllFaults(uint64_t seed) {
  MaskDamage damage;
  damage.drop_share = 0.2;
  damage.flicker_share = 0.1;
  damage.border_px = 4;
  damage.merge_share = 0.3;
  damage.split_share = 0.2;
  damage.leak_share = 0.3;
  damage.class_flip_share = 0.3;
  damage.false_positive_share = 0.4;
  damage.crowd = 12;
  damage.permute_labels = true;
  damage.seed = seed;
  return damage;
}

TEST(MaskDamage, KeepsLabelsAndInstancesConsistent) {
  for (const auto& frame : DamagedFrames(AllFaults(3), 60)) EXPECT_EQ(InconsistencyOf(*frame), "") << frame->frame_id;
}

TEST(MaskDamage, DependsOnlyOnSeedAndFrameId) {
  const auto all = DamagedFrames(AllFaults(3), 30);
  const auto others = DamagedFrames(AllFaults(4), 30);
  MaskDamager damager(AllFaults(3), kClasses);
  int different = 0;
  for (size_t i = 0; i < all.size(); i += 3) {
    EXPECT_TRUE(SameMasks(*damager.Damage(SixSquares(i + 1)), *all[i]));
    different += SameMasks(*others[i], *all[i]) ? 0 : 1;
  }
  EXPECT_GE(different, 9);
}

TEST(MaskDamage, OneFaultDoesNotChangeAnother) {
  MaskDamage with_flips{.drop_share = 0.3, .seed = 5};
  const auto dropped = DamagedFrames(with_flips, 40);
  with_flips.class_flip_share = 0.5;
  const auto both = DamagedFrames(with_flips, 40);
  for (size_t i = 0; i < dropped.size(); ++i) {
    EXPECT_EQ(cv::countNonZero(dropped[i]->labels != both[i]->labels), 0);
  }
}

TEST(MaskDamage, DropsTheGivenShare) {
  size_t remaining = 0;
  for (const auto& frame : DamagedFrames({.drop_share = 0.3}, 200)) remaining += frame->instances.size();
  EXPECT_NEAR(static_cast<double>(remaining) / 1200, 0.7, 0.04);
}

TEST(MaskDamage, RunsAtTheGivenRate) {
  // 25 frames a second.
  int masked = 0;
  uint64_t last = 0;
  for (const auto& frame : DamagedFrames({.rate_hz = 5}, 100)) {
    if (!frame->has_masks) {
      EXPECT_TRUE(frame->labels.empty());
      EXPECT_TRUE(frame->instances.empty());
      continue;
    }
    EXPECT_TRUE(SameMasks(*frame, SixSquares(frame->frame_id)));
    if (last > 0) {
      EXPECT_NEAR(static_cast<double>(frame->frame_id - last), 5, 1);
    }
    last = frame->frame_id;
    ++masked;
  }
  EXPECT_NEAR(masked, 20, 1);
}

TEST(MaskDamage, DeliversLateMasksInOrder) {
  MaskDamager damager({.rate_hz = 12.5, .late_s = 0.2}, kClasses);
  std::vector<uint64_t> arrived;
  for (uint64_t i = 1; i <= 50; ++i) {
    const Frame frame = SixSquares(i);
    EXPECT_FALSE(damager.Damage(frame)->has_masks);
    while (const auto masks = damager.TakeLateMasks(frame.timestamp_ns)) {
      EXPECT_GE(i - masks->frame_id, 5U) << "0.2 s are five frames";
      EXPECT_LE(i - masks->frame_id, 6U);
      EXPECT_EQ(cv::countNonZero(masks->labels != frame.labels), 0);
      EXPECT_EQ(masks->instances.size(), 6U);
      arrived.push_back(masks->frame_id);
    }
  }
  EXPECT_NEAR(static_cast<double>(arrived.size()), 23, 2);
  EXPECT_TRUE(std::is_sorted(arrived.begin(), arrived.end()));
}

TEST(MaskDamage, FlickerHidesAnObjectForSeveralFrames) {
  const int run_frames = 8;
  std::map<uint32_t, int> missing_frames;
  std::map<uint32_t, int> runs;
  std::set<uint32_t> missing_before;
  for (const auto& frame : DamagedFrames({.flicker_share = 0.3, .flicker_frames = run_frames}, 800)) {
    std::set<uint32_t> missing = {1, 2, 3, 4, 5, 6};
    for (const Instance& instance : frame->instances) missing.erase(instance.label);
    for (const uint32_t label : missing) {
      ++missing_frames[label];
      if (!missing_before.contains(label)) ++runs[label];
    }
    missing_before = missing;
  }
  int frames = 0;
  for (uint32_t label = 1; label <= 6; ++label) {
    frames += missing_frames[label];
    EXPECT_GE(missing_frames[label], (run_frames - 1) * runs[label])
        << "missing for too few frames in a row: mask " << label;
  }
  EXPECT_NEAR(frames / 4800.0, 0.3, 0.06);
}

TEST(MaskDamage, MovesBordersSmoothlyByUpToTheAmplitude) {
  const double amplitude_px = 4;
  int changed = 0;
  for (const auto& frame : DamagedFrames({.border_px = amplitude_px}, 10)) {
    const Frame truth = SixSquares(frame->frame_id);
    for (uint32_t label = 3; label <= 6; ++label) {  // the masks without a touching neighbor
      const cv::Mat is = frame->labels == static_cast<int>(label);
      const cv::Mat was = truth.labels == static_cast<int>(label);
      cv::Mat core, max_area, outline;
      const int size_px = 2 * static_cast<int>(amplitude_px) + 3;
      const cv::Mat square = cv::Mat::ones(size_px, size_px, CV_8UC1);
      cv::erode(was, core, square);
      cv::dilate(was, max_area, square);
      EXPECT_EQ(cv::countNonZero(core & ~is), 0) << "pixels missing inside mask " << label;
      EXPECT_EQ(cv::countNonZero(is & ~max_area), 0) << "displaced by more than the amplitude: mask " << label;
      changed += cv::countNonZero(is != was);
      // Smooth: one component, and a morphological opening removes only its corners.
      cv::Mat components;
      EXPECT_EQ(cv::connectedComponents(is, components), 2);
      cv::Mat opened;
      cv::morphologyEx(is, opened, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8UC1));
      EXPECT_LT(cv::countNonZero(is != opened), 30);
    }
  }
  const double mean_shift_px = changed / (10.0 * 4 * 160);
  EXPECT_GT(mean_shift_px, 0.25 * amplitude_px);
  EXPECT_LT(mean_shift_px, 0.75 * amplitude_px);
}

TEST(MaskDamage, FlipsClassesToOtherGivenClasses) {
  int flipped = 0;
  for (const auto& frame : DamagedFrames({.class_flip_share = 0.1}, 300)) {
    const Frame truth = SixSquares(frame->frame_id);
    EXPECT_EQ(cv::countNonZero(frame->labels != truth.labels), 0);
    for (size_t i = 0; i < 6; ++i) {
      EXPECT_TRUE(std::binary_search(kClasses.begin(), kClasses.end(), frame->instances[i].class_name));
      flipped += frame->instances[i].class_name != truth.instances[i].class_name ? 1 : 0;
    }
  }
  EXPECT_NEAR(flipped / 1800.0, 0.1, 0.03);
}

TEST(MaskDamage, MergesTouchingMasks) {
  for (const auto& frame : DamagedFrames({.merge_share = 1}, 5)) {
    EXPECT_EQ(frame->instances.size(), 5U);
    EXPECT_EQ(std::max(Area_px(*frame, 1), Area_px(*frame, 2)), 3200);
  }
  size_t merged = 0;
  for (const auto& frame : DamagedFrames({.merge_share = 0.05}, 400)) merged += 6 - frame->instances.size();
  EXPECT_NEAR(static_cast<double>(merged) / 400, 0.05, 0.03);
}

TEST(MaskDamage, SplitsMasksIntoTwoOfTheSameClass) {
  for (const auto& frame : DamagedFrames({.split_share = 1}, 5)) {
    ASSERT_EQ(frame->instances.size(), 12U);
    std::map<std::string, int> count;
    for (const Instance& instance : frame->instances) {
      ++count[instance.class_name];
      EXPECT_NEAR(Area_px(*frame, instance.label), 800, 120) << "split at the centroid";
    }
    EXPECT_EQ(count["cup"], 4);
    EXPECT_EQ(count["vase"], 2);
  }
}

TEST(MaskDamage, ExtendsMasksAcrossTheirBorder) {
  for (const auto& frame : DamagedFrames({.leak_share = 1}, 10)) {
    const Frame truth = SixSquares(frame->frame_id);
    ASSERT_EQ(frame->instances.size(), 6U);
    for (uint32_t label = 3; label <= 6; ++label) {
      EXPECT_GT(Area_px(*frame, label), 1650);
      EXPECT_LT(Area_px(*frame, label), 2600);
      cv::Mat components;
      EXPECT_EQ(cv::connectedComponents(frame->labels == static_cast<int>(label), components), 2)
          << "the blob is connected to the mask";
    }
  }
}

TEST(MaskDamage, FalsePositivesPersistForSomeFramesOutsideOtherMasks) {
  int frames_with_false_positive = 0;
  std::map<uint64_t, cv::Mat> blob_of_window;
  for (const auto& frame : DamagedFrames({.false_positive_share = 0.5, .false_positive_frames = 5}, 400)) {
    const Frame truth = SixSquares(frame->frame_id);
    EXPECT_EQ(cv::countNonZero((frame->labels != truth.labels) & (truth.labels != 0)), 0);
    ASSERT_LE(frame->instances.size(), 7U);
    const cv::Mat blob = frame->labels == 7;
    frames_with_false_positive += frame->instances.size() == 7 ? 1 : 0;
    const auto [first, is_first] = blob_of_window.try_emplace(frame->frame_id / 5, blob);
    EXPECT_EQ(cv::countNonZero(first->second != blob), 0) << "frame " << frame->frame_id;
  }
  EXPECT_NEAR(frames_with_false_positive / 400.0, 0.5, 0.15);
}

TEST(MaskDamage, SomeFramesHaveNoDetections) {
  int empty = 0;
  for (const auto& frame : DamagedFrames({.empty_share = 0.2}, 300)) {
    EXPECT_TRUE(frame->has_masks) << "the detector processed the frame";
    ASSERT_FALSE(frame->labels.empty());
    if (!frame->instances.empty()) continue;
    EXPECT_EQ(cv::countNonZero(frame->labels), 0);
    ++empty;
  }
  EXPECT_NEAR(empty / 300.0, 0.2, 0.07);
}

TEST(MaskDamage, AddsInstancesUpToTheCrowdSize) {
  for (const auto& frame : DamagedFrames({.crowd = 200, .permute_labels = true}, 3)) {
    EXPECT_EQ(frame->instances.size(), 200U);
    EXPECT_EQ(InconsistencyOf(*frame), "");
  }
}

TEST(MaskDamage, PermutingLabelsKeepsTheMasks) {
  std::set<uint32_t> labels_of_vase;
  for (const auto& frame : DamagedFrames({.permute_labels = true}, 20)) {
    const Frame truth = SixSquares(frame->frame_id);
    ASSERT_EQ(frame->instances.size(), 6U);
    for (const Instance& instance : frame->instances) {
      double was = 0;
      const cv::Mat pixels = frame->labels == static_cast<int>(instance.label);
      cv::minMaxLoc(truth.labels, nullptr, &was, nullptr, nullptr, pixels);
      EXPECT_EQ(instance.class_name, truth.instances[static_cast<size_t>(was) - 1].class_name);
      EXPECT_EQ(cv::countNonZero(pixels), 1600);
      if (instance.class_name == "vase") labels_of_vase.insert(instance.label);
    }
  }
  EXPECT_GT(labels_of_vase.size(), 10U);
}

}  // namespace romap::mask_damage_test
