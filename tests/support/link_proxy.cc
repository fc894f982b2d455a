#include "tests/support/link_proxy.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <vector>

namespace romap::testing_support {
namespace {

constexpr size_t kPieceBytes = 64 << 10;

sockaddr_in Loopback(const std::string& ip, int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  inet_pton(AF_INET, ip.c_str(), &address.sin_addr);
  return address;
}

}  // namespace

LinkProxy::LinkProxy(const std::string& server) {
  const size_t colon = server.rfind(':');
  server_ip_ = server.substr(0, colon);
  server_port_ = std::stoi(server.substr(colon + 1));
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  sockaddr_in address = Loopback("127.0.0.1", 0);
  socklen_t length = sizeof(address);
  if (bind(listener_, reinterpret_cast<sockaddr*>(&address), length) != 0 || listen(listener_, 16) != 0 ||
      getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &length) != 0) {
    throw std::runtime_error("the proxy cannot listen");
  }
  address_ = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  thread_ = std::thread([this] { Run(); });
}

LinkProxy::~LinkProxy() {
  stop_ = true;
  thread_.join();
  CloseAll();
  close(listener_);
}

void LinkProxy::Cut(std::chrono::milliseconds for_how_long) {
  refuse_until_ = Clock::now() + for_how_long;
  cut_ = true;
}

void LinkProxy::Run() {
  while (!stop_) {
    if (cut_.exchange(false)) CloseAll();
    std::vector<pollfd> polled{{listener_, POLLIN, 0}};
    if (!stalled_) {
      for (const auto& [fd, direction] : directions_) {
        if (direction.waiting.empty()) polled.push_back({fd, POLLIN, 0});
      }
    }
    poll(polled.data(), polled.size(), 2);
    if (polled[0].revents != 0) Accept();
    for (size_t i = 1; i < polled.size(); ++i) {
      const auto it = directions_.find(polled[i].fd);
      if (polled[i].revents == 0 || it == directions_.end()) continue;
      std::string piece(kPieceBytes, '\0');
      const ssize_t bytes = recv(it->first, piece.data(), piece.size(), MSG_DONTWAIT);
      if (bytes < 0 && (errno == EAGAIN || errno == EINTR)) continue;
      if (bytes <= 0) {
        Close(it->first);
        continue;
      }
      piece.resize(static_cast<size_t>(bytes));
      it->second.waiting = std::move(piece);
      it->second.due = Clock::now() + delay_.load();
    }
    if (stalled_) continue;
    std::vector<int> readers;
    for (const auto& [fd, direction] : directions_) {
      if (!direction.waiting.empty() && Clock::now() >= direction.due) readers.push_back(fd);
    }
    for (const int fd : readers) {
      if (const auto it = directions_.find(fd); it != directions_.end()) Forward(fd, it->second);
    }
  }
}

void LinkProxy::Accept() {
  const int client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
  if (client < 0) return;
  const int server = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in address = Loopback(server_ip_, server_port_);
  if (Clock::now() < refuse_until_.load() ||
      connect(server, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    close(client);
    close(server);
    return;
  }
  const int on = 1;
  setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  setsockopt(server, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  directions_[client].to = server;
  directions_[server].to = client;
  ++connections_;
}

void LinkProxy::Forward(int from, Direction& direction) {
  const ssize_t bytes =
      send(direction.to, direction.waiting.data(), direction.waiting.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  if (bytes < 0 && (errno == EAGAIN || errno == EINTR)) return;
  if (bytes < 0) return Close(from);
  direction.waiting.erase(0, static_cast<size_t>(bytes));
}

// Closes both sides.
void LinkProxy::Close(int fd) {
  const int other = directions_.at(fd).to;
  for (const int side : {fd, other}) {
    directions_.erase(side);
    close(side);
  }
}

void LinkProxy::CloseAll() {
  while (!directions_.empty()) Close(directions_.begin()->first);
}

}  // namespace romap::testing_support
