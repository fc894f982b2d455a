#include "server/http/connection_guard.h"

#include <arpa/inet.h>
#include <event2/buffer.h>
#include <event2/bufferevent.h>
#include <netinet/tcp.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <utility>

namespace romap::http {
namespace {

constexpr std::chrono::seconds kMessagePeriod{10};
constexpr size_t kMaxEarlyBytes = size_t{256} << 10;

std::string PeerOf(int fd) {
  sockaddr_storage peer{};
  socklen_t length = sizeof(peer);
  if (getpeername(fd, reinterpret_cast<sockaddr*>(&peer), &length) != 0) return "";
  std::array<char, INET6_ADDRSTRLEN> text{};
  const void* address = peer.ss_family == AF_INET6
                            ? static_cast<const void*>(&reinterpret_cast<const sockaddr_in6&>(peer).sin6_addr)
                            : static_cast<const void*>(&reinterpret_cast<const sockaddr_in&>(peer).sin_addr);
  inet_ntop(peer.ss_family, address, text.data(), text.size());
  return text.data();
}

ino_t InodeAt(int fd) {
  struct stat status {};
  return fstat(fd, &status) == 0 ? status.st_ino : 0;
}

// evhttp notices it and frees the connection.
void Close(int fd) { shutdown(fd, SHUT_RDWR); }

// The same at once, without reading what the peer sends on.
void Abort(int fd) {
  const sockaddr nobody{.sa_family = AF_UNSPEC, .sa_data = {}};
  if (connect(fd, &nobody, sizeof(nobody)) != 0) Close(fd);
}

}  // namespace

ConnectionGuard::~ConnectionGuard() {
  for (const auto& [connection, is_usable] : added_) bufferevent_decref(connection);
}

void ConnectionGuard::Add(bufferevent* connection, bool is_usable) {
  bufferevent_incref(connection);
  added_.emplace_back(connection, is_usable);
}

void ConnectionGuard::Inspect() {
  for (const auto& [connection, is_usable] : std::exchange(added_, {})) {
    Follow(connection, is_usable);
    bufferevent_decref(connection);
  }
}

void ConnectionGuard::Follow(bufferevent* connection, bool is_usable) {
  const int fd = bufferevent_getfd(connection);
  if (fd < 0) return;                                                       // it has failed already
  if (const auto old = connections_.find(fd); old != connections_.end()) {  // closed, and the descriptor used again
    received_bytes_ -= old->second.received_bytes;
    connections_.erase(old);
  }
  if (!is_usable) return Close(fd);
  const std::string peer = PeerOf(fd);
  if (!HasRoomFor(peer)) ForgetClosed();
  if (!HasRoomFor(peer)) {
    Close(fd);
    return NoteRefused(peer);
  }
  const int on = 1;
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  Connection& added = connections_[fd];
  added = {.guard = this, .fd = fd, .inode = InodeAt(fd), .peer = peer, .since = Clock::now()};
  evbuffer_add_cb(bufferevent_get_input(connection), OnInput, &added);
}

void ConnectionGuard::OnInput(evbuffer* /*buffer*/, const evbuffer_cb_info* info, void* connection) {
  auto& receiving = *static_cast<Connection*>(connection);
  ConnectionGuard& guard = *receiving.guard;
  receiving.received_bytes += info->n_added;
  guard.received_bytes_ += info->n_added;
  if (info->n_added == 0) return;
  // While its request is answered, a client has little to say.
  const bool is_flood = receiving.state != State::kReceiving && info->orig_size + info->n_added > kMaxEarlyBytes;
  if (is_flood || guard.received_bytes_ > guard.limits_.received_bytes) Abort(receiving.fd);
}

void ConnectionGuard::SetState(int fd, State state) {
  const auto found = connections_.find(fd);
  if (found == connections_.end()) return;
  Connection& connection = found->second;
  connection.state = state;
  connection.since = Clock::now();
  if (state != State::kReceiving && state != State::kStreaming) return;
  received_bytes_ -= std::exchange(connection.received_bytes, 0);
}

void ConnectionGuard::Sweep() {
  ForgetClosed();
  const Clock::time_point now = Clock::now();
  for (const auto& [fd, connection] : connections_) {
    const bool is_late = (connection.state == State::kReceiving && now - connection.since > limits_.request_timeout) ||
                         (connection.state == State::kSending && now - connection.since > limits_.response_timeout);
    if (is_late) Close(fd);
  }
}

void ConnectionGuard::ForgetClosed() {
  std::erase_if(connections_, [&](const auto& entry) {
    if (InodeAt(entry.first) == entry.second.inode) return false;
    received_bytes_ -= entry.second.received_bytes;
    return true;
  });
}

bool ConnectionGuard::HasRoomFor(const std::string& peer) const {
  if (connections_.size() >= limits_.total) return false;
  const auto of_peer =
      std::ranges::count_if(connections_, [&](const auto& entry) { return entry.second.peer == peer; });
  return static_cast<size_t>(of_peer) < limits_.per_peer;
}

void ConnectionGuard::NoteRefused(const std::string& peer) {
  ++refused_;
  if (Clock::now() < next_message_) return;
  next_message_ = Clock::now() + kMessagePeriod;
  spdlog::warn(
      "http: refused {} connections, the last one from {}: {} are open; the limits are {} in all and {} per address "
      "(http.max_connections, http.max_connections_per_peer)",
      std::exchange(refused_, 0), peer, connections_.size(), limits_.total, limits_.per_peer);
}

}  // namespace romap::http
