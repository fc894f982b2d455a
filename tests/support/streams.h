#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <optional>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "common/mapping_service.h"
#include "tests/support/sanitizer.h"

// Helpers for tests of a MappingService. All waits end with a test failure after kTimeout.

namespace romap::testing_support {

// Long under a sanitizer, where a busy machine trains a small field in minutes.
inline constexpr std::chrono::seconds kTimeout{testing_support::kUnderSanitizer ? 240 : 60};

inline CameraModel SmallCamera() {
  CameraModel camera;
  camera.width_px = 64;
  camera.height_px = 48;
  camera.fx_px = camera.fy_px = 60;
  camera.cx_px = 31.5;
  camera.cy_px = 23.5;
  return camera;
}

// A valid frame of SmallCamera(). With `class_name`, its masks have one instance of that class.
inline FrameInput MakeFrame(uint64_t frame_id, const std::string& class_name = "") {
  const CameraModel camera = SmallCamera();
  FrameInput frame;
  frame.frame_id = frame_id;
  frame.timestamp_ns = static_cast<int64_t>(frame_id) * 33'000'000;
  frame.image_encoding = ImageEncoding::kRawGray8;
  frame.raw_width_px = camera.width_px;
  frame.raw_height_px = camera.height_px;
  frame.image.assign(static_cast<size_t>(camera.width_px * camera.height_px), '\x80');
  frame.T_world_camera.emplace(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.01 * frame_id, 0, 0));
  if (!class_name.empty()) {
    const auto pixels = static_cast<uint32_t>(camera.width_px * camera.height_px);
    frame.mask_encoding = MaskEncoding::kRunLength;
    frame.label_runs = {7, 100, 0, pixels - 100};
    frame.instances = {{.label = 7, .class_name = class_name, .score = 0.9, .track_id = std::nullopt}};
  }
  return frame;
}

// Returns the next event of type T and skips all others; nullopt if the stream ends first.
template <class T>
std::optional<T> NextOf(EventStream& stream) {
  const auto deadline = std::chrono::steady_clock::now() + kTimeout;
  while (std::chrono::steady_clock::now() < deadline) {
    std::optional<MapEvent> event = stream.Next(std::chrono::milliseconds(100));
    if (event && std::holds_alternative<T>(*event)) return std::get<T>(*std::move(event));
    if (!event && stream.Done()) return std::nullopt;
  }
  ADD_FAILURE() << "no event of this type within " << kTimeout.count() << " s, and the stream did not end";
  return std::nullopt;
}

// All events up to the end of the stream.
inline std::vector<MapEvent> ReadToEnd(EventStream& stream) {
  std::vector<MapEvent> events;
  const auto deadline = std::chrono::steady_clock::now() + kTimeout;
  while (std::chrono::steady_clock::now() < deadline) {
    std::optional<MapEvent> event = stream.Next(std::chrono::milliseconds(100));
    if (event) events.push_back(*std::move(event));
    if (!event && stream.Done()) return events;
  }
  ADD_FAILURE() << "the stream did not end within " << kTimeout.count() << " s";
  return events;
}

template <class T>
std::vector<T> Only(const std::vector<MapEvent>& events) {
  std::vector<T> kind;
  for (const MapEvent& event : events) {
    if (std::holds_alternative<T>(event)) kind.push_back(std::get<T>(event));
  }
  return kind;
}

// Waits until the condition is true. False, with a test failure, after kTimeout.
inline bool Eventually(const std::function<bool()>& condition) {
  const auto deadline = std::chrono::steady_clock::now() + kTimeout;
  while (std::chrono::steady_clock::now() < deadline) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  ADD_FAILURE() << "the condition did not become true within " << kTimeout.count() << " s";
  return false;
}

}  // namespace romap::testing_support

// Assertions on absl::Status that print it on failure.
#define EXPECT_OK(expression)                        \
  do {                                               \
    const absl::Status status_ = (expression);       \
    EXPECT_TRUE(status_.ok()) << status_.ToString(); \
  } while (0)
#define EXPECT_CODE(expression, expected_code)                        \
  do {                                                                \
    const absl::Status status_ = (expression);                        \
    EXPECT_EQ(status_.code(), (expected_code)) << status_.ToString(); \
  } while (0)
