// The limits of a tenant, as its callers meet them.

#include <gmock/gmock.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "common/status.h"
#include "server/access/authenticator.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::access::tenant_limits_test {

using absl::StatusCode;
using std::chrono::steady_clock;
using ::testing::HasSubstr;
using testing_support::SmallCamera;

// Each session needs 1 GiB on the disk.
class StoringService : public testing_support::FakeMappingService {
 public:
  absl::StatusOr<std::vector<SessionInfo>> ListSessions() override {
    auto sessions = FakeMappingService::ListSessions();
    for (SessionInfo& info : *sessions) info.stored_bytes = uint64_t{1} << 30;
    return sessions;
  }
};

class TenantLimitsTest : public ::testing::Test {
 protected:
  void Start(const AccessConfig& config) { authenticator_ = std::make_unique<Authenticator>(&fake_, path_, config); }
  std::shared_ptr<MappingService> ServiceOf(const std::string& tenant) {
    const std::string token = tokens_.Create("a", tenant, Role::kOwner).value();
    return authenticator_->Authenticate("Bearer " + token).value().service;
  }
  static std::string NewSession(MappingService& service) {
    return service.CreateSession({.name = "", .camera = SmallCamera()}).value().id;
  }
  static FrameInput Frame(uint64_t id, size_t bytes = 100) {
    FrameInput frame;
    frame.frame_id = id;
    frame.image = std::string(bytes, 'x');
    return frame;
  }

  testing_support::TemporaryFolder folder_;
  std::string path_ = folder_ / "tokens.json";
  StoringService fake_;
  TokenStore tokens_{path_};
  std::unique_ptr<Authenticator> authenticator_;
};

TEST_F(TenantLimitsTest, AllStreamsOfATenantShareItsRate) {
  AccessConfig config;
  config.max_inputs_per_s_per_tenant = 20;
  Start(config);
  const auto lab = ServiceOf("lab"), same = ServiceOf("lab"), office = ServiceOf("office");
  const auto first = lab->OpenMap(NewSession(*lab)).value(), second = same->OpenMap(NewSession(*same)).value();
  const auto start = steady_clock::now();
  for (uint64_t id = 1; id <= 15; ++id) {
    EXPECT_OK(first->Send(Frame(id)));
    EXPECT_OK(second->SendMasks({{}, id, false}));
  }
  // 20 inputs pass at once, and 10 more need half a second.
  EXPECT_GE(steady_clock::now() - start, std::chrono::milliseconds(400));
  const auto other = office->OpenMap(NewSession(*office)).value();
  EXPECT_OK(other->Send(Frame(1)));
}

TEST_F(TenantLimitsTest, TheEndOfAStreamWakesASenderThatWaits) {
  AccessConfig config;
  config.max_mib_per_s_per_tenant = 0.01;
  Start(config);
  const auto lab = ServiceOf("lab");
  const auto stream = lab->OpenMap(NewSession(*lab)).value();
  std::atomic<bool> is_sent = false;
  std::thread sender([&] {
    stream->Send(Frame(1, 1 << 24)).IgnoreError();  // would wait for 1600 s
    is_sent = true;
  });
  stream->Cancel();
  sender.join();
  EXPECT_TRUE(is_sent);
}

TEST_F(TenantLimitsTest, AFullShareOfTheDiskRefusesNewSessionsAndInputs) {
  AccessConfig config;
  config.max_stored_gib_per_tenant = 1.5;
  Start(config);
  const auto lab = ServiceOf("lab"), office = ServiceOf("office");
  const std::string first = NewSession(*lab);
  const auto stream = lab->OpenMap(first).value();
  const std::string second = NewSession(*lab);
  for (const absl::Status& status :
       {lab->CreateSession({.name = "", .camera = SmallCamera()}).status(), lab->OpenMap(second).status(),
        lab->LoadSession([] { return std::string(); }).status(), stream->Send(Frame(1))}) {
    EXPECT_CODE(status, StatusCode::kResourceExhausted);
    EXPECT_THAT(Message(status), HasSubstr("the tenant lab need 2.00 GiB on the disk, and 1.50 GiB are allowed"));
  }
  EXPECT_OK(office->CreateSession({.name = "", .camera = SmallCamera()}).status());
  EXPECT_OK(lab->DeleteSession(second));
  EXPECT_OK(lab->OpenMap(first, stream->opening().resume_token).status());
}

}  // namespace romap::access::tenant_limits_test
