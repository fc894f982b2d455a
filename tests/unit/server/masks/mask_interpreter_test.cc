#include "server/masks/mask_interpreter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "common/label_image.h"

namespace romap::masks::mask_interpreter_test {

constexpr uint16_t kSurface = 200;
constexpr uint16_t kGripper = 9;
constexpr int kObjects = 4;

// A row of square objects on a textured table that moves to the left with every frame.
class Scene {
 public:
  Frame MakeFrame(int index) const {
    Frame frame;
    frame.frame_id = static_cast<uint64_t>(index) + 1;
    frame.has_masks = true;
    frame.image_bgr = world_(cv::Rect(4 * index, 0, 320, 240)).clone();
    frame.labels = cv::Mat::zeros(240, 320, CV_16UC1);
    for (int object = 0; object < kObjects; ++object) {
      const cv::Rect box =
          cv::Rect(60 + 80 * object - 4 * index, 90 + 15 * (object % 2), 40, 40) & cv::Rect(0, 0, 320, 240);
      const auto label = static_cast<uint16_t>(object + 1);
      frame.labels(box).setTo(label);
      frame.instances.push_back({.label = label, .class_name = "box", .score = 1, .track_id = {}});
    }
    return frame;
  }

  // Gives a label to the background within `reach_px` of the objects.
  static void AddSurface(const std::string& class_name, int reach_px, Frame* frame) {
    cv::Mat near;
    cv::dilate(frame->labels > 0, near, cv::Mat::ones(2 * reach_px + 1, 2 * reach_px + 1, CV_8U));
    frame->labels.setTo(kSurface, near & (frame->labels == 0));
    frame->instances.push_back({.label = kSurface, .class_name = class_name, .score = 1, .track_id = {}});
  }

  static void AddGripper(Frame* frame) {
    const cv::Rect box(90, 170, 120, 70);
    cv::Mat texture(box.size(), CV_8UC3);
    cv::RNG(3).fill(texture, cv::RNG::UNIFORM, 0, 255);
    texture.copyTo(frame->image_bgr(box));
    frame->labels(box).setTo(kGripper);
    frame->instances.push_back({.label = kGripper, .class_name = "gripper", .score = 1, .track_id = {}});
  }

 private:
  static cv::Mat MakeWorld() {
    cv::Mat small(30, 90, CV_8UC3), world;
    cv::RNG(1).fill(small, cv::RNG::UNIFORM, 0, 255);
    cv::resize(small, world, cv::Size(720, 240), 0, 0, cv::INTER_CUBIC);
    return world;
  }

  cv::Mat world_ = MakeWorld();
};

bool HasInstance(const Frame& frame, uint16_t label) {
  return std::any_of(frame.instances.begin(), frame.instances.end(), [&](const auto& i) { return i.label == label; });
}

class MaskInterpreterTest : public ::testing::Test {
 protected:
  // Interprets `count` frames of the scene, each changed first. Returns the last one.
  template <class Change>
  Frame InterpretFrames(int count, const Change& change) {
    Frame frame;
    for (int index = 0; index < count; ++index) {
      frame = scene_.MakeFrame(index);
      change(&frame);
      interpreter_.Interpret(true, &frame);
    }
    return frame;
  }

  bool HasDiagnostic(const std::string& code) const {
    const std::vector<Diagnostic> diagnostics = interpreter_.Diagnostics();
    return std::any_of(diagnostics.begin(), diagnostics.end(), [&](const Diagnostic& d) { return d.code == code; });
  }

  Scene scene_;
  MaskInterpreter interpreter_;
};

TEST_F(MaskInterpreterTest, LeavesMasksOfObjectsAlone) {
  for (int index = 0; index < 20; ++index) {
    Frame frame = scene_.MakeFrame(index);
    const cv::Mat before = frame.labels.clone();
    interpreter_.Interpret(true, &frame);
    EXPECT_EQ(cv::norm(before, frame.labels, cv::NORM_INF), 0);
    EXPECT_EQ(frame.instances.size(), static_cast<size_t>(kObjects));
    EXPECT_TRUE(frame.non_objects.empty());
  }
  EXPECT_TRUE(interpreter_.Diagnostics().empty());
}

TEST_F(MaskInterpreterTest, TheSurroundingsOfObjectsAreBackground) {
  for (const int reach_px : {25, 300}) {
    for (const char* name : {"dining table", "object"}) {
      interpreter_ = {};
      const Frame frame = InterpretFrames(5, [&](Frame* f) { Scene::AddSurface(name, reach_px, f); });
      EXPECT_FALSE(HasInstance(frame, kSurface)) << reach_px;
      EXPECT_EQ(cv::countNonZero(frame.labels == kSurface), 0);
      EXPECT_TRUE(HasInstance(frame, 1));
      ASSERT_EQ(frame.non_objects.size(), 1u);
      EXPECT_EQ(frame.non_objects[0].class_name, name);
      EXPECT_TRUE(HasDiagnostic("mask_is_background"));
    }
  }
}

// A sofa with two cushions in front of a wall without a mask.
TEST_F(MaskInterpreterTest, AnObjectThatSurroundsAFewOthersStays) {
  const Frame frame = InterpretFrames(10, [](Frame* f) {
    f->labels.setTo(0, f->labels > 2);
    std::erase_if(f->instances, [](const auto& i) { return i.label > 2; });
    Scene::AddSurface("sofa", 20, f);
  });
  EXPECT_TRUE(HasInstance(frame, kSurface));
}

TEST_F(MaskInterpreterTest, ADiagnosticNamesAFewClassesOnly) {
  for (int surface = 0; surface < 20; ++surface) {
    InterpretFrames(6, [&](Frame* f) { Scene::AddSurface("table " + std::to_string(surface), 20, f); });
  }
  const std::string text = interpreter_.Diagnostics().front().text;
  EXPECT_NE(text.find("\"table 0\""), std::string::npos) << text;
  EXPECT_NE(text.find(" and others "), std::string::npos) << text;
  EXPECT_EQ(text.find("\"table 19\""), std::string::npos) << text;
}

TEST_F(MaskInterpreterTest, WhatMovesWithTheCameraIsNoObjectAndHidesWhatIsBehindIt) {
  const Frame frame = InterpretFrames(40, Scene::AddGripper);
  EXPECT_FALSE(HasInstance(frame, kGripper));
  EXPECT_EQ(frame.labels.at<uint16_t>(200, 150), kIgnoreLabel);
  EXPECT_TRUE(HasDiagnostic("mask_moves_with_camera"));
}

TEST_F(MaskInterpreterTest, LateMasksOfWhatMovesWithTheCamera) {
  FrameMasks masks;
  for (int index = 0; index < 40; ++index) {
    Frame frame = scene_.MakeFrame(index);
    Scene::AddGripper(&frame);
    masks = {.frame_id = frame.frame_id, .labels = frame.labels, .instances = frame.instances};
    frame.has_masks = false;
    frame.labels = cv::Mat();
    frame.instances.clear();
    interpreter_.Interpret(true, &frame);
    interpreter_.Interpret(true, &masks);
  }
  EXPECT_EQ(masks.labels.at<uint16_t>(200, 150), kIgnoreLabel);
  ASSERT_EQ(masks.non_objects.size(), 1u);
}

TEST_F(MaskInterpreterTest, AGripperWithoutAMaskIsNoBackground) {
  const Frame frame = InterpretFrames(40, [](Frame* f) {
    const cv::Mat before = f->labels.clone();
    Scene::AddGripper(f);
    f->labels = before;
    f->instances.pop_back();
  });
  EXPECT_EQ(frame.labels.at<uint16_t>(205, 150), kIgnoreLabel);
  EXPECT_EQ(frame.labels.at<uint16_t>(20, 20), 0);
  EXPECT_EQ(frame.labels.at<uint16_t>(200, 300), 0);
  EXPECT_TRUE(HasDiagnostic("image_part_moves_with_camera"));
}

TEST_F(MaskInterpreterTest, AGripperOfACameraThatStandsStillIsNotJudged) {
  const Frame still = scene_.MakeFrame(0);
  const Frame frame = InterpretFrames(40, [&](Frame* f) {
    f->image_bgr = still.image_bgr.clone();
    f->labels = still.labels.clone();
    Scene::AddGripper(f);
  });
  EXPECT_TRUE(HasInstance(frame, kGripper));
}

// The camera moves around an object in the middle of the image.
TEST_F(MaskInterpreterTest, AnObjectThatStaysInTheMiddleOfTheImageStays) {
  const Frame frame = InterpretFrames(40, [](Frame* f) {
    f->labels(cv::Rect(140, 60, 50, 100)).setTo(30);
    f->image_bgr(cv::Rect(140, 60, 50, 100)).setTo(cv::Scalar::all(128));
    f->instances.push_back({.label = 30, .class_name = "vase", .score = 1, .track_id = {}});
  });
  EXPECT_TRUE(HasInstance(frame, 30));
}

void AddVoid(const std::string& class_name, Frame* frame) {
  frame->labels(cv::Rect(10, 10, 30, 30)).setTo(255);
  frame->instances.push_back({.label = 255, .class_name = class_name, .score = 1, .track_id = {}});
}

TEST_F(MaskInterpreterTest, TheValue255IsIgnoredAmongOtherLabels) {
  const Frame frame = InterpretFrames(1, [](Frame* f) { AddVoid("object", f); });
  EXPECT_EQ(frame.labels.at<uint16_t>(20, 20), kIgnoreLabel);
  EXPECT_FALSE(HasInstance(frame, 255));
  EXPECT_TRUE(HasDiagnostic("mask_value_255_ignored"));
}

TEST_F(MaskInterpreterTest, NamesMasksWithoutBackground) {
  InterpretFrames(12, [](Frame* f) { f->labels.setTo(kIgnoreLabel, f->labels == 0); });
  EXPECT_TRUE(HasDiagnostic("masks_without_background"));
}

TEST_F(MaskInterpreterTest, UnknownBordersLeaveABackground) {
  InterpretFrames(12, [](Frame* f) { f->labels(cv::Rect(10, 10, 200, 40)).setTo(kIgnoreLabel); });
  EXPECT_FALSE(HasDiagnostic("masks_without_background"));
}

TEST_F(MaskInterpreterTest, TheValue255IsAnObjectInBinaryMasks) {
  const Frame frame = InterpretFrames(10, [](Frame* f) {
    f->labels.setTo(255, f->labels > 0);
    f->instances = {{.label = 255, .class_name = "object", .score = 1, .track_id = {}}};
  });
  EXPECT_TRUE(HasInstance(frame, 255));
}

TEST_F(MaskInterpreterTest, TheValue255IsAnObjectIfTheClientSaysSo) {
  EXPECT_TRUE(HasInstance(InterpretFrames(1, [](Frame* f) { AddVoid("mug", f); }), 255));
}

TEST_F(MaskInterpreterTest, TheValue255IsAnObjectIn16Bits) {
  Frame frame = scene_.MakeFrame(0);
  AddVoid("object", &frame);
  interpreter_.Interpret(/*eight_bit=*/false, &frame);
  EXPECT_TRUE(HasInstance(frame, 255));
}

}  // namespace romap::masks::mask_interpreter_test
