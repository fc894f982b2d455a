#pragma once

#include <gtest/gtest.h>

#include "client/files/sequence.h"
#include "client/synth/synth.h"
#include "tests/support/subprocess.h"

namespace romap::testing {

// Two made objects seen by a few small frames, with all truth: written anew by every test.
class TinySequence {
 public:
  TinySequence() {
    synth::SynthOptions options;
    options.seed = 3;
    options.objects = 2;
    options.frames = 24;
    options.width_px = 160;
    options.height_px = 120;
    EXPECT_TRUE(synth::MakeSequence(options, dir()).ok());
  }

  std::string dir() const { return folder_ / "sequence"; }
  std::string operator/(const std::string& name) const { return folder_ / name; }
  Sequence Open() const {
    absl::StatusOr<Sequence> sequence = Sequence::Open(dir(), {.use_depth = true});
    EXPECT_TRUE(sequence.ok()) << Message(sequence.status());
    return *std::move(sequence);
  }

 private:
  testing_support::TemporaryFolder folder_;
};

}  // namespace romap::testing
