#include "server/transport/listener.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <mutex>

#include "client/sdk/remote_mapping_service.h"
#include "common/status.h"
#include "server/transport/grpc_server.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/streams.h"

namespace romap::transport::listener_test {

using ::testing::HasSubstr;
using testing_support::Eventually;

// A connection of a peer that says nothing.
class IdlePeer {
 public:
  explicit IdlePeer(int port) : fd_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
  }
  IdlePeer(IdlePeer&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  ~IdlePeer() {
    if (fd_ >= 0) close(fd_);
  }
  // Whether the server has closed the connection.
  bool IsClosed() const {
    char byte = 0;
    const ssize_t bytes = recv(fd_, &byte, 1, MSG_DONTWAIT | MSG_PEEK);
    return bytes == 0 || (bytes < 0 && errno != EAGAIN);
  }

 private:
  int fd_;
};

class ListenerTest : public ::testing::Test {
 protected:
  ~ListenerTest() override {
    listener_->Stop();
    for (const int fd : accepted_) close(fd);
  }
  void Start(const ConnectionLimits& limits) {
    listener_ = Listener::Open({.host = "127.0.0.1", .port = 0}).value();
    listener_->Start(limits, [this](int fd) {
      std::lock_guard lock(mutex_);
      accepted_.push_back(fd);
    });
  }
  size_t Accepted() {
    std::lock_guard lock(mutex_);
    return accepted_.size();
  }

  std::unique_ptr<Listener> listener_;
  std::mutex mutex_;
  std::vector<int> accepted_;
};

TEST_F(ListenerTest, AcceptsUpToTheLimitAndAgainWhenConnectionsWereClosed) {
  Start({.total = 3, .per_peer = 3});
  std::vector<IdlePeer> peers;
  for (int i = 0; i < 5; ++i) peers.emplace_back(listener_->port());
  EXPECT_TRUE(Eventually([&] { return peers[3].IsClosed() && peers[4].IsClosed(); }));
  EXPECT_EQ(Accepted(), 3u);
  EXPECT_EQ(listener_->OpenConnections(), 3);
  EXPECT_FALSE(peers[0].IsClosed());
  {
    std::lock_guard lock(mutex_);
    close(accepted_[1]);
    accepted_.erase(accepted_.begin() + 1);
  }
  peers.emplace_back(listener_->port());
  EXPECT_TRUE(Eventually([&] { return Accepted() == 3; }));
  EXPECT_FALSE(peers.back().IsClosed());
}

TEST_F(ListenerTest, OneAddressHasItsOwnLimit) {
  Start({.total = 10, .per_peer = 2});
  std::vector<IdlePeer> peers;
  for (int i = 0; i < 3; ++i) peers.emplace_back(listener_->port());
  EXPECT_TRUE(Eventually([&] { return peers[2].IsClosed(); }));
  EXPECT_EQ(Accepted(), 2u);
}

TEST_F(ListenerTest, AnAddressInUseIsRefused) {
  Start({});
  const auto second = Listener::Open({.host = "127.0.0.1", .port = listener_->port()});
  EXPECT_EQ(second.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(Message(Listener::Open({.host = "no.such.host.invalid", .port = 0}).status()),
              HasSubstr("cannot listen on no.such.host.invalid:0"));
}

TEST(ConnectionLimitsTest, StayBelowTheLimitOfFiles) {
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  const rlimit before = files;
  files.rlim_cur = 600;
  setrlimit(RLIMIT_NOFILE, &files);
  const ConnectionLimits limits = WithinFileLimit({.total = 5000, .per_peer = 3000});
  setrlimit(RLIMIT_NOFILE, &before);
  EXPECT_LT(limits.total, 600);
  EXPECT_GT(limits.total, 300);
  EXPECT_LE(limits.per_peer, limits.total);
}

// Connections that never become calls take all places, but not for long.
TEST(IdleConnectionsTest, DoNotShutTheServerToNewcomers) {
  testing_support::FakeMappingService fake;
  TransportConfig config;
  config.listen_address = "127.0.0.1:0";
  config.max_connections = config.max_connections_per_peer = 8;
  config.handshake_timeout_s = 0.5;
  const auto server = GrpcServer::Start(&fake, config).value();
  std::vector<IdlePeer> peers;
  for (int i = 0; i < 30; ++i) peers.emplace_back(server->port());
  client::RemoteOptions options;
  options.connect_timeout = std::chrono::milliseconds(20'000);
  EXPECT_OK(client::RemoteMappingService::Connect(server->address(), options).status());
}

}  // namespace romap::transport::listener_test
