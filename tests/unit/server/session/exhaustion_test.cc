// A process without more memory or threads.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <future>
#include <memory>
#include <system_error>
#include <thread>
#include <vector>

#include "common/status.h"
#include "server/session/local_mapping_service.h"
#include "tests/support/sanitizer.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::session::exhaustion_test {

constexpr const char* kMessage = "the server has too little memory or too few threads for one more session";

SessionOptions Options() {
  SessionOptions options;
  options.camera = testing_support::SmallCamera();
  return options;
}

// While it exists, the process can start `threads` more threads: others wait on all stacks for which there is memory.
// RLIMIT_NPROC would not stop a test that runs as root.
class FewThreads {
 public:
  explicit FewThreads(size_t threads) {
    getrlimit(RLIMIT_AS, &before_);
    uint64_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    rlimit limit = before_;
    limit.rlim_cur = pages * static_cast<uint64_t>(sysconf(_SC_PAGESIZE)) + kMemory_bytes;
    setrlimit(RLIMIT_AS, &limit);
    try {
      while (true) waiting_.push_back(std::make_unique<Waiting>());
    } catch (const std::system_error&) {
    }
    waiting_.resize(waiting_.size() - std::min(threads, waiting_.size()));  // the C library keeps their stacks
  }
  ~FewThreads() { setrlimit(RLIMIT_AS, &before_); }

 private:
  struct Waiting {
    ~Waiting() {
      end.set_value();
      thread.join();
    }
    std::promise<void> end;
    std::thread thread{[ended = end.get_future().share()] { ended.wait(); }};
  };
  static constexpr rlim_t kMemory_bytes = 40 << 20;

  rlimit before_{};
  std::vector<std::unique_ptr<Waiting>> waiting_;
};

// Ends the process, because the limit is one of the process.
void CreateWithFewThreads() {
  LocalMappingService service({});
  for (const size_t threads : {0, 1, 2}) {
    const FewThreads limited(threads);
    const auto session = service.CreateSession(Options());
    if (session.ok()) _exit(2);
    if (!absl::IsResourceExhausted(session.status())) _exit(3);
    if (Message(session.status()).find(kMessage) == std::string::npos) _exit(4);
  }
  if (service.ListSessions()->size() != 0) _exit(5);
  const auto session = service.CreateSession(Options());
  if (!session.ok()) _exit(6);
  auto stream = service.OpenMap(session->id).value();
  if (!stream->Send(testing_support::MakeFrame(1)).ok()) _exit(7);
  const auto ack = testing_support::NextOf<FrameAck>(*stream);
  _exit(ack && ack->accepted ? 0 : 8);
}

void RestoreWithFewThreads(const std::string& folder) {
  std::string id;
  const auto start = [&] {
    store::StoreConfig config;
    config.data_dir = folder;
    return std::make_unique<LocalMappingService>(ServerConfig{}, store::Store::Open(config).value());
  };
  {
    const auto service = start();
    id = service->CreateSession(Options())->id;
  }
  const auto service = start();
  for (const size_t threads : {0, 1, 2, 3}) {
    const FewThreads limited(threads);
    const auto stream = service->OpenMap(id);
    if (stream.ok()) _exit(2);
    if (!absl::IsResourceExhausted(stream.status())) _exit(3);
  }
  if (service->ListSessions()->size() != 1) _exit(4);
  const bool opened = testing_support::Eventually([&] { return service->OpenMap(id).ok(); });
  _exit(opened ? 0 : 5);
}

class ExhaustionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (testing_support::kUnderSanitizer) GTEST_SKIP() << "a sanitizer ends a process without memory";
    GTEST_FLAG_SET(death_test_style, "threadsafe");
  }
  testing_support::TemporaryFolder folder_;
};

TEST_F(ExhaustionTest, NoThreadForANewSession) { EXPECT_EXIT(CreateWithFewThreads(), testing::ExitedWithCode(0), ""); }

TEST_F(ExhaustionTest, NoThreadForARestoredSession) {
  EXPECT_EXIT(RestoreWithFewThreads(folder_.path()), testing::ExitedWithCode(0), "");
}

}  // namespace romap::session::exhaustion_test
