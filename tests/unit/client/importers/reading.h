#pragma once

#include <gtest/gtest.h>

#include <string>

#include "client/importers/open_recording.h"
#include "tests/support/foreign_layouts.h"
#include "tests/support/subprocess.h"

namespace romap::importers_testing {

// Depth images are read too, and frames without timestamps have the rate of a sample.
inline importers::ReadOptions SampleOptions() {
  importers::ReadOptions options;
  options.fps = 10;
  options.files.use_depth = true;
  return options;
}

// Opens a recording that must be readable.
inline files::Sequence Read(const std::string& source, const importers::ReadOptions& options = SampleOptions()) {
  absl::StatusOr<files::Sequence> sequence = importers::OpenRecording(source, options);
  if (!sequence.ok()) throw std::runtime_error(Message(sequence.status()));  // fails the test
  return *std::move(sequence);
}

// The message of a recording that must not be readable.
inline std::string ReadError(const std::string& source, const importers::ReadOptions& options = SampleOptions()) {
  const absl::StatusOr<files::Sequence> sequence = importers::OpenRecording(source, options);
  EXPECT_FALSE(sequence.ok());
  return Message(sequence.status());
}

// The diagnostic with a code; a default one, with a test failure, if there is none.
inline Diagnostic DiagnosticOf(const files::Sequence& sequence, const std::string& code) {
  for (const Diagnostic& diagnostic : sequence.diagnostics()) {
    if (diagnostic.code == code) return diagnostic;
  }
  ADD_FAILURE() << "no diagnostic " << code;
  return {};
}

// The sample with depth in blocks of 2x2 pixels, as an image of half the resolution can represent it.
inline testing_support::SampleRecording WithDepthInBlocks(testing_support::SampleRecording sample) {
  for (testing_support::SampleFrame& frame : sample.frames) {
    for (int y = 0; y < frame.depth_mm.rows; ++y) {
      for (int x = 0; x < frame.depth_mm.cols; ++x) {
        frame.depth_mm.at<uint16_t>(y, x) = frame.depth_mm.at<uint16_t>(y & ~1, x & ~1);
      }
    }
  }
  return sample;
}

}  // namespace romap::importers_testing
