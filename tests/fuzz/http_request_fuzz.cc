// HTTP requests, as bytes on a connection: parsing, checks and routes. libevent reads the connection as in the server.

#include <event2/buffer.h>
#include <event2/event.h>
#include <event2/http.h>
#include <event2/listener.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <memory>

#include "common/status.h"
#include "romap/v1/mapping.pb.h"
#include "server/http/class_filter.h"
#include "server/http/json.h"
#include "server/http/request_check.h"
#include "server/http/request_reader.h"
#include "server/http/route.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/quiet_protobuf.h"

namespace romap::fuzz::http_request_fuzz {
namespace {

constexpr std::string_view kSocketName("\0romap_fuzz_http", 16);  // begins with 0: not a file

sockaddr_un Address() {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string name = std::string(kSocketName) + std::to_string(getpid());
  name.copy(address.sun_path, sizeof(address.sun_path));
  return address;
}

void Answer(evhttp_request* request, void* /*unused*/) {
  const auto read = http::ReadRequest(request);
  if (read.ok()) {
    for (const bool is_loopback : {false, true}) (void)http::CheckRequest(*read, is_loopback);
    const auto route = http::ParseRoute(read->method, read->path);
    if (route.ok()) {
      Require(read->path.find(route->session_id) != std::string::npos, "the id of the session is in the path");
    }
    for (const auto& [name, value] : read->query) (void)http::ParseClasses(value);
    v1::CreateSessionRequest session;
    if (http::FromJson(read->body, &session).ok()) (void)http::ToJson(session);
  }
  evhttp_send_reply(request, read.ok() ? 200 : 400, "OK", nullptr);
}

class Server {
 public:
  Server() : base_(event_base_new()), http_(evhttp_new(base_)) {
    evhttp_set_max_headers_size(http_, 16 << 10);
    evhttp_set_max_body_size(http_, 1 << 20);
    evhttp_set_allowed_methods(http_, EVHTTP_REQ_GET | EVHTTP_REQ_POST | EVHTTP_REQ_DELETE);
    evhttp_set_gencb(http_, Answer, nullptr);
    const sockaddr_un address = Address();
    evconnlistener* listener =
        evconnlistener_new_bind(base_, nullptr, nullptr, LEV_OPT_CLOSE_ON_FREE | LEV_OPT_CLOSE_ON_EXEC, 4,
                                reinterpret_cast<const sockaddr*>(&address), sizeof(address));
    Require(listener != nullptr && evhttp_bind_listener(http_, listener) != nullptr, "the server listens");
  }
  ~Server() {
    evhttp_free(http_);
    event_base_free(base_);
  }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // Serves one connection until the server closes it.
  void Serve(const uint8_t* data, size_t size) {
    const sockaddr_un address = Address();
    const int client = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    Require(connect(client, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0, "a client connects");
    (void)send(client, data, size, MSG_NOSIGNAL);  // more than the buffer of the socket is cut off
    shutdown(client, SHUT_WR);
    char answer[4096];
    bool is_closed = false;
    for (int turn = 0; turn < 10000 && !is_closed; ++turn) {
      event_base_loop(base_, EVLOOP_NONBLOCK);
      ssize_t got = 0;
      while ((got = recv(client, answer, sizeof(answer), 0)) > 0) {
      }
      is_closed = got == 0 || errno != EAGAIN;
    }
    close(client);
    event_base_loop(base_, EVLOOP_NONBLOCK);
    Require(is_closed, "the server closes a connection that sends no more");
  }

 private:
  event_base* base_;
  evhttp* http_;
};

}  // namespace
}  // namespace romap::fuzz::http_request_fuzz

std::vector<std::string> romap::fuzz::Seeds() {
  const std::string body =
      R"({"name":"kitchen","camera":{"widthPx":640,"heightPx":480,"fxPx":500},"mode":"FRAME_MODE_LIVE"})";
  return {"GET /api/v1/sessions HTTP/1.1\r\nHost: localhost\r\n\r\n",
          "GET /api/v1/sessions/12ab/events?classes=cup%2Cbook&x HTTP/1.1\r\nHost: 127.0.0.1:8080\r\nAuthorization: "
          "Bearer romap_1\r\nAccept-Encoding: gzip\r\n\r\n",
          "GET /api/v1/sessions/12ab/objects/3/mesh/45/levels/1 HTTP/1.0\r\n\r\n",
          "DELETE /api/v1/sessions/12ab HTTP/1.1\r\nHost: a\r\nX-Romap: 1\r\n\r\n",
          "POST /api/v1/sessions HTTP/1.1\r\nHost: [::1]\r\nContent-Type: application/json; charset=utf-8\r\n"
          "Content-Length: " +
              std::to_string(body.size()) + "\r\n\r\n" + body,
          "POST /api/v1/sessions/12ab/frames HTTP/1.1\r\nHost: localhost\r\nContent-Type: image/jpeg\r\n"
          "Transfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n0\r\n\r\n"};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static romap::fuzz::http_request_fuzz::Server server;
  server.Serve(data, size);
  return 0;
}
