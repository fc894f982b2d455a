#include "tests/support/cuda_on_host/race_checker.h"

#include <gtest/gtest.h>

#include "tests/support/cuda_on_host/block_runner.h"
#include "tests/unit/support/cuda_on_host/race/race_kernels.h"

namespace romap::race_checker_test {

using cuda_on_host::FirstRace;
using cuda_on_host::RaceCount;
using cuda_on_host::ResetRaces;
using cuda_on_host::SetRunOptions;
using cuda_on_host::ThreadOrder;

struct Pattern {
  const char* name;
  void (*run)(bool correct);
  const char* memory;
};

class RaceChecker : public testing::TestWithParam<Pattern> {
 protected:
  void SetUp() override { ResetRaces(); }
};

INSTANTIATE_TEST_SUITE_P(Patterns, RaceChecker,
                         testing::Values(Pattern{"TreeSum", RunTreeSum, "shared"},
                                         Pattern{"LaneExchange", RunLaneExchange, "shared"},
                                         Pattern{"Count", RunCount, "device"},
                                         Pattern{"NeighborRead", RunNeighborRead, "device"},
                                         Pattern{"BufferReuse", RunBufferReuse, "shared"}),
                         [](const auto& info) { return info.param.name; });

TEST_P(RaceChecker, CorrectKernelsHaveNoRace) {
  for (const ThreadOrder order : {ThreadOrder::kForward, ThreadOrder::kReverse, ThreadOrder::kShuffled}) {
    for (const int workers : {1, 2}) {
      SetRunOptions({.order = order, .workers = workers});
      GetParam().run(true);
      EXPECT_EQ(RaceCount(), 0) << FirstRace();
    }
  }
}

// In every order, including those in which the result happens to be correct.
TEST_P(RaceChecker, MistakesAreReported) {
  for (const ThreadOrder order : {ThreadOrder::kForward, ThreadOrder::kReverse, ThreadOrder::kShuffled}) {
    SetRunOptions({.order = order});
    ResetRaces();
    GetParam().run(false);
    EXPECT_GT(RaceCount(), 0);
    EXPECT_NE(FirstRace().find(GetParam().memory), std::string::npos) << FirstRace();
  }
}

}  // namespace romap::race_checker_test
