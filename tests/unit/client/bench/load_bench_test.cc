#include "client/bench/load_bench.h"

#include <gmock/gmock.h>

#include "common/status.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/streams.h"
#include "tests/unit/client/bench/tiny_sequence.h"

namespace romap::bench::load_bench_test {

using ::testing::Each;
using ::testing::Field;
using ::testing::Gt;
using ::testing::SizeIs;

// Two sessions are enough.
class SmallService : public testing_support::FakeMappingService {
 public:
  absl::StatusOr<SessionInfo> CreateSession(const SessionOptions& options) override {
    if (ListSessions()->size() >= 2) return absl::ResourceExhaustedError("full");
    EXPECT_EQ(options.mode, FrameMode::kLive);
    return FakeMappingService::CreateSession(options);
  }
};

TEST(LoadBenchTest, ClientsSendViewersReadAndTheRestIsRefused) {
  const testing_support::TinySequence data;
  SmallService service;
  const LoadOptions options{
      .clients = 3, .viewers = 2, .stalled_viewers = 1, .rate_hz = 50, .duration_s = 1, .pose_use = PoseUse::kGiven};
  double last = 0;
  const LoadResults results = RunLoadBench(
                                  data.Open(), service, options,
                                  [&](double fraction, const std::string&) { last = fraction; }, [] { return false; })
                                  .value();
  EXPECT_GT(last, 0);
  ASSERT_THAT(results.clients, SizeIs(3));
  EXPECT_EQ(results.clients[2].refused, "full");
  for (int i = 0; i < 2; ++i) {
    const ClientLoad& client = results.clients[static_cast<size_t>(i)];
    EXPECT_EQ(client.error, "");
    EXPECT_GT(client.sent, 1u);
    EXPECT_EQ(client.acknowledged, client.sent);
    EXPECT_THAT(client.ack_s, SizeIs(client.sent));
    EXPECT_THAT(client.ack_s, Each(Gt(0)));
  }
  EXPECT_THAT(results.viewers, Each(Field(&ViewerLoad::events, Gt(0u))));
  EXPECT_THAT(results.viewers, SizeIs(2));
  EXPECT_THAT(*service.ListSessions(), SizeIs(0)) << "the sessions are deleted";
}

TEST(LoadBenchTest, AnInterruptEndsTheLoadEarly) {
  const testing_support::TinySequence data;
  SmallService service;
  const LoadOptions options{.clients = 1, .rate_hz = 20, .duration_s = 1e5};
  const auto results = RunLoadBench(
      data.Open(), service, options, [](double, const std::string&) {}, [] { return true; });
  EXPECT_OK(results.status());
  EXPECT_LT(results->duration_s, 1e4);
}

}  // namespace romap::bench::load_bench_test
