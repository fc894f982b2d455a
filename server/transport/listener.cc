#include "server/transport/listener.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "common/status.h"

namespace romap::transport {
namespace {

constexpr int kReservedFiles = 256;  // for the store, the log and the threads of gRPC
constexpr std::chrono::seconds kMessagePeriod{10};
constexpr std::chrono::milliseconds kPauseWithoutFiles{100};

std::string AddressOf(const sockaddr_storage& peer) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  const void* address = peer.ss_family == AF_INET6
                            ? static_cast<const void*>(&reinterpret_cast<const sockaddr_in6&>(peer).sin6_addr)
                            : static_cast<const void*>(&reinterpret_cast<const sockaddr_in&>(peer).sin_addr);
  inet_ntop(peer.ss_family, address, text.data(), text.size());
  return text.data();
}

int PortOf(int fd) {
  sockaddr_storage address{};
  socklen_t length = sizeof(address);
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
  return ntohs(address.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(address).sin6_port
                                             : reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

uint64_t InodeOf(int fd) {
  struct stat status {};
  return fstat(fd, &status) == 0 ? status.st_ino : 0;
}

}  // namespace

ConnectionLimits WithinFileLimit(ConnectionLimits limits) {
  rlimit files{};
  if (getrlimit(RLIMIT_NOFILE, &files) != 0 || files.rlim_cur == RLIM_INFINITY) return limits;
  const int64_t room = static_cast<int64_t>(files.rlim_cur) - kReservedFiles;
  limits.total = static_cast<int>(std::min<int64_t>(limits.total, std::max<int64_t>(room, 16)));
  limits.per_peer = std::min(limits.per_peer, limits.total);
  return limits;
}

absl::StatusOr<std::unique_ptr<Listener>> Listener::Open(const HostPort& address) {
  std::unique_ptr<Listener> listener(new Listener);
  std::string host = address.host;
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  addrinfo hints{};
  hints.ai_flags = AI_PASSIVE;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int error = getaddrinfo(host.c_str(), std::to_string(address.port).c_str(), &hints, &found);
  if (error != 0) {
    return absl::UnavailableError(
        fmt::format("cannot listen on {}:{}: {}", address.host, address.port, gai_strerror(error)));
  }
  int bind_error = 0;
  for (const addrinfo* entry = found; entry != nullptr; entry = entry->ai_next) {
    if (!listener->Bind(entry)) bind_error = errno;
  }
  freeaddrinfo(found);
  listener->stop_fd_ = eventfd(0, EFD_CLOEXEC);
  if (!listener->listening_fds_.empty() && listener->stop_fd_ >= 0) return listener;
  return absl::UnavailableError(fmt::format("cannot listen on {}:{}: the address is in use or not available ({})",
                                            address.host, address.port, std::strerror(bind_error)));
}

// All addresses of a host get the same port.
bool Listener::Bind(const void* addrinfo) {
  const auto& entry = *static_cast<const struct addrinfo*>(addrinfo);
  const int fd = socket(entry.ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return false;
  const int on = 1, off = 0;
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));  // connections inherit it
  sockaddr_storage address{};
  std::memcpy(&address, entry.ai_addr, entry.ai_addrlen);
  if (entry.ai_family == AF_INET6) {
    setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof(off));  // [::] also accepts IPv4
    auto& v6 = reinterpret_cast<sockaddr_in6&>(address);
    if (v6.sin6_port == 0) v6.sin6_port = htons(static_cast<uint16_t>(port_));
  } else {
    auto& v4 = reinterpret_cast<sockaddr_in&>(address);
    if (v4.sin_port == 0) v4.sin_port = htons(static_cast<uint16_t>(port_));
  }
  if (bind(fd, reinterpret_cast<const sockaddr*>(&address), entry.ai_addrlen) != 0 || listen(fd, SOMAXCONN) != 0) {
    const int error = errno;
    close(fd);
    errno = error;
    return false;
  }
  port_ = PortOf(fd);
  listening_fds_.push_back(fd);
  return true;
}

Listener::~Listener() {
  Stop();
  if (stop_fd_ >= 0) close(stop_fd_);
}

void Listener::Start(const ConnectionLimits& limits, Handler handler) {
  limits_ = limits;
  handler_ = std::move(handler);
  thread_ = std::thread([this] { Run(); });
}

void Listener::Stop() {
  if (thread_.joinable()) {
    eventfd_write(stop_fd_, 1);
    thread_.join();
  }
  for (const int fd : listening_fds_) close(fd);
  listening_fds_.clear();
}

void Listener::Run() {
  std::vector<pollfd> polled{{.fd = stop_fd_, .events = POLLIN, .revents = 0}};
  for (const int fd : listening_fds_) polled.push_back({.fd = fd, .events = POLLIN, .revents = 0});
  while (true) {
    if (poll(polled.data(), polled.size(), /*timeout=*/-1) < 0 && errno != EINTR) return;
    if (polled[0].revents != 0) return;
    for (size_t i = 1; i < polled.size(); ++i) {
      if (polled[i].revents != 0) Accept(polled[i].fd);
    }
  }
}

void Listener::Accept(int listening_fd) {
  sockaddr_storage address{};
  socklen_t length = sizeof(address);
  const int fd = accept4(listening_fd, reinterpret_cast<sockaddr*>(&address), &length, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (fd < 0) {
    if (errno != EMFILE && errno != ENFILE && errno != ENOBUFS && errno != ENOMEM) return;  // the peer has gone
    spdlog::warn("cannot accept a connection: {}", std::strerror(errno));
    std::this_thread::sleep_for(kPauseWithoutFiles);
    return;
  }
  if (const std::string peer = AddressOf(address); !Register(fd, peer)) {
    close(fd);
    return;
  }
  handler_(fd);
}

// False: the limits are reached.
bool Listener::Register(int fd, const std::string& peer) {
  std::lock_guard lock(mutex_);
  connections_.erase(fd);  // it is a new file, so the old one was closed
  if (!HasRoomFor(peer)) ForgetClosed();
  if (!HasRoomFor(peer)) {
    NoteRefused(peer);
    return false;
  }
  connections_[fd] = {.inode = InodeOf(fd), .peer = peer};
  return true;
}

int Listener::OpenConnections() {
  std::lock_guard lock(mutex_);
  ForgetClosed();
  return static_cast<int>(connections_.size());
}

void Listener::ForgetClosed() {
  std::erase_if(connections_, [](const auto& entry) { return InodeOf(entry.first) != entry.second.inode; });
}

bool Listener::HasRoomFor(const std::string& peer) const {
  if (connections_.size() >= static_cast<size_t>(limits_.total)) return false;
  const auto of_peer =
      std::ranges::count_if(connections_, [&](const auto& entry) { return entry.second.peer == peer; });
  return of_peer < limits_.per_peer;
}

void Listener::NoteRefused(const std::string& peer) {
  ++refused_;
  if (Clock::now() < next_message_) return;
  next_message_ = Clock::now() + kMessagePeriod;
  spdlog::warn(
      "refused {} connections, the last one from {}: {} are open; the limits are {} in all and {} per address "
      "(transport.max_connections, transport.max_connections_per_peer)",
      std::exchange(refused_, 0), peer, connections_.size(), limits_.total, limits_.per_peer);
}

}  // namespace romap::transport
