#include "tests/support/cuda_on_host/race_checker.h"

#include <gtest/gtest.h>

#include "tests/support/cuda_on_host/block_runner.h"
#include "tests/unit/support/cuda_on_host/race/race_kernels.h"

namespace romap {
namespace {

using cuda_on_host::FirstRace;
using cuda_on_host::RaceCount;
using cuda_on_host::ResetRaces;
using cuda_on_host::RunOptions;
using cuda_on_host::SetRunOptions;
using cuda_on_host::ThreadOrder;

struct Pattern {
  const char* name;
  void (*run)(bool right);
  const char* memory;
};

class RaceChecker : public testing::TestWithParam<Pattern> {
 protected:
  void SetUp() override { cuda_on_host::ResetRaces(); }
};

INSTANTIATE_TEST_SUITE_P(Patterns, RaceChecker,
                         testing::Values(Pattern{"TreeSum", RunTreeSum, "shared"},
                                         Pattern{"LaneExchange", RunLaneExchange, "shared"},
                                         Pattern{"Count", RunCount, "device"},
                                         Pattern{"NeighbourRead", RunNeighbourRead, "device"},
                                         Pattern{"BufferReuse", RunBufferReuse, "shared"}),
                         [](const auto& info) { return info.param.name; });

TEST_P(RaceChecker, RightKernelsHaveNoRace) {
  for (const cuda_on_host::ThreadOrder order :
       {cuda_on_host::ThreadOrder::kForward, cuda_on_host::ThreadOrder::kReverse,
        cuda_on_host::ThreadOrder::kShuffled}) {
    for (const int workers : {1, 2}) {
      cuda_on_host::SetRunOptions({.order = order, .workers = workers});
      GetParam().run(true);
      EXPECT_EQ(cuda_on_host::RaceCount(), 0) << cuda_on_host::FirstRace();
    }
  }
}

// In every order, also in those where the result happens to be right.
TEST_P(RaceChecker, PlantedMistakesAreFound) {
  for (const cuda_on_host::ThreadOrder order :
       {cuda_on_host::ThreadOrder::kForward, cuda_on_host::ThreadOrder::kReverse,
        cuda_on_host::ThreadOrder::kShuffled}) {
    cuda_on_host::SetRunOptions({.order = order});
    cuda_on_host::ResetRaces();
    GetParam().run(false);
    EXPECT_GT(cuda_on_host::RaceCount(), 0);
    EXPECT_NE(cuda_on_host::FirstRace().find(GetParam().memory), std::string::npos) << cuda_on_host::FirstRace();
  }
}

}  // namespace
}  // namespace romap
