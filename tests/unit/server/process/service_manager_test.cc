#include "server/process/service_manager.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <string>

#include "tests/support/subprocess.h"

namespace romap::process::service_manager_test {

// The socket of systemd.
class NotifySocket {
 public:
  NotifySocket() {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path_.c_str(), sizeof(address.sun_path) - 1);
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    const timeval patience{.tv_sec = 20, .tv_usec = 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    setenv("NOTIFY_SOCKET", path_.c_str(), 1);
  }
  ~NotifySocket() {
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    close(socket_);
  }
  // Waits for the next message; empty after 20 s.
  std::string Next() const {
    std::array<char, 256> text{};
    const ssize_t length = recv(socket_, text.data(), text.size(), 0);
    return length > 0 ? std::string(text.data(), static_cast<size_t>(length)) : "";
  }

 private:
  const testing_support::TemporaryFolder folder_;
  const std::string path_ = folder_ / "notify";
  const int socket_ = socket(AF_UNIX, SOCK_DGRAM, 0);
};

TEST(ServiceManagerTest, SaysWhenItServesAndWhenItStops) {
  const NotifySocket systemd;
  {
    const ServiceManager manager([] { ADD_FAILURE() << "there is no watchdog"; });
    EXPECT_EQ(systemd.Next(), "READY=1");
  }
  EXPECT_EQ(systemd.Next(), "STOPPING=1");
}

TEST(ServiceManagerTest, AnswersTheWatchdogAfterEachCheck) {
  const NotifySocket systemd;
  setenv("WATCHDOG_USEC", "20000", 1);
  std::atomic<int> checks = 0;
  const ServiceManager manager([&] { ++checks; });
  int answers = 0;
  while (answers < 5) {
    const std::string message = systemd.Next();
    ASSERT_TRUE(message == "READY=1" || message == "WATCHDOG=1") << message;
    answers += message == "WATCHDOG=1" ? 1 : 0;
  }
  EXPECT_GE(checks, 5);
}

TEST(ServiceManagerTest, WithoutSystemdNothingHappens) {
  const ServiceManager manager([] { ADD_FAILURE() << "there is no watchdog"; });
}

}  // namespace romap::process::service_manager_test
