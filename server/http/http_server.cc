#include "server/http/http_server.h"

#include <arpa/inet.h>
#include <event2/buffer.h>
#include <event2/bufferevent.h>
#include <event2/http.h>
#include <event2/keyvalq_struct.h>
#include <event2/listener.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <exception>
#include <optional>
#include <utility>

#include "common/host_port.h"
#include "common/printable.h"
#include "common/status.h"
#include "server/http/api.h"
#include "server/http/connection_guard.h"
#include "server/http/event_loop.h"
#include "server/http/exchange.h"
#include "server/http/frame_feeds.h"
#include "server/http/request_check.h"
#include "server/http/request_reader.h"
#include "server/http/tls_context.h"
#include "server/http/viewers.h"
#include "server/http/worker_pool.h"
#include "server/transport/listener.h"

namespace romap::http {
namespace {

constexpr size_t kMaxHeaderBytes = size_t{16} << 10;
constexpr size_t kMaxWaitingCalls = 64;
constexpr size_t kMaxCachedMeshBytes = size_t{128} << 20;
constexpr size_t kMaxReceivedBytes = size_t{64} << 20;
constexpr std::chrono::milliseconds kViewerPeriod{30};
constexpr std::chrono::milliseconds kFeedPeriod{10};
constexpr std::chrono::milliseconds kSweepPeriod{500};
// Longer than all limits of the guard, which knows what a connection does.
constexpr int kLibeventTimeout_s = 3 * 3600;

std::chrono::milliseconds ToMilliseconds(double seconds) {
  return std::chrono::milliseconds(static_cast<int64_t>(1000 * seconds));
}

ConnectionGuard::Limits LimitsOf(const HttpConfig& config) {
  const transport::ConnectionLimits connections =
      transport::WithinFileLimit({.total = config.max_connections, .per_peer = config.max_connections_per_peer});
  return {.total = static_cast<size_t>(connections.total),
          .per_peer = static_cast<size_t>(connections.per_peer),
          .received_bytes = std::max(kMaxReceivedBytes, size_t{2} * static_cast<size_t>(config.max_body_bytes)),
          .request_timeout = ToMilliseconds(config.request_timeout_s),
          .response_timeout = ToMilliseconds(config.response_timeout_s)};
}

int PortOf(int fd) {
  sockaddr_storage address{};
  socklen_t length = sizeof(address);
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
  return ntohs(address.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(address).sin6_port
                                             : reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

absl::Status ShuttingDown() { return absl::UnavailableError("the server is shutting down"); }

absl::Status TooManyCalls() { return absl::ResourceExhaustedError("the server has too many requests; try again"); }

}  // namespace

class HttpServer::Impl {
 public:
  Impl(const access::Authenticator* authenticator, Options options)
      : authenticator_(*authenticator),
        options_(std::move(options)),
        metrics_(options_.metrics),
        meshes_(kMaxCachedMeshBytes),
        api_(authenticator, &meshes_, static_cast<size_t>(options_.config.max_body_bytes)),
        guard_(LimitsOf(options_.config)),
        http_(evhttp_new(loop_.base()), evhttp_free),
        pool_(options_.config.workers, kMaxWaitingCalls) {
    if (!http_) throw std::bad_alloc();
    host_.guard = &guard_;
    host_.count_response = [this](int code) { metrics_.CountResponse(code); };
    viewers_.emplace(&meshes_, &pool_);
    feeds_.emplace(authenticator, &loop_, &pool_);
  }
  ~Impl() { Shutdown(); }

  absl::Status Start() {
    const std::optional<HostPort> address = ParseHostPort(options_.config.listen_address);
    if (!address) {
      return InvalidArgument("http.listen_address: must be HOST:PORT, e.g. {}, or empty, is '{}'",
                             kDefaultListenAddress, options_.config.listen_address);
    }
    is_loopback_ = IsLoopback(*address);
    ROMAP_ASSIGN_OR_RETURN(tls_, TlsContext::Load(options_.tls));
    evhttp_set_max_headers_size(http_.get(), kMaxHeaderBytes);
    evhttp_set_max_body_size(http_.get(), options_.config.max_body_bytes);
    evhttp_set_timeout(http_.get(), kLibeventTimeout_s);
    evhttp_set_allowed_methods(http_.get(), EVHTTP_REQ_GET | EVHTTP_REQ_POST | EVHTTP_REQ_DELETE);
    evhttp_set_bevcb(
        http_.get(), [](event_base*, void* self) { return static_cast<Impl*>(self)->NewConnection(); }, this);
    evhttp_set_gencb(
        http_.get(),
        [](evhttp_request* request, void* self) {
          try {
            static_cast<Impl*>(self)->OnRequest(request);
          } catch (const std::exception& e) {  // must not pass through libevent
            spdlog::error("http: a request failed: {}", e.what());
          }
        },
        this);
    ROMAP_RETURN_IF_ERROR(Listen(*address));
    // The loop runs a little longer than both.
    loop_.Every(kViewerPeriod, [this] {
      if (viewers_) viewers_->Pump();
    });
    loop_.Every(kFeedPeriod, [this] {
      if (feeds_) feeds_->Pump();
    });
    loop_.Every(kSweepPeriod, [this] {
      guard_.Sweep();
      if (bound_ != nullptr) evconnlistener_enable(evhttp_bound_socket_get_listener(bound_));
      metrics_.SetGauges({.viewers = viewers_ ? viewers_->size() : 0,
                          .connections = guard_.connections(),
                          .mesh_cache_bytes = meshes_.bytes()});
    });
    loop_.Start();
    is_running_ = true;
    return absl::OkStatus();
  }

  void Shutdown() {
    if (!is_running_) return;
    is_running_ = false;
    // The workers' last answers need the loop; after it nothing uses the connections.
    loop_.Call([this] {
      evhttp_del_accept_socket(http_.get(), std::exchange(bound_, nullptr));
      viewers_->EndAll(ShuttingDown());
    });
    pool_.Stop();
    loop_.Call([this] {
      feeds_.reset();
      viewers_.reset();
    });
    loop_.Stop();
    http_.reset();
  }

  const std::string& address() const { return address_; }
  std::string url() const { return fmt::format("{}://{}/", tls_ ? "https" : "http", address_); }

 private:
  absl::Status Listen(const HostPort& address) {
    std::string host = address.host;
    if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
    errno = 0;
    bound_ = evhttp_bind_socket_with_handle(http_.get(), host.c_str(), static_cast<uint16_t>(address.port));
    if (bound_ == nullptr) {
      return absl::UnavailableError(fmt::format("cannot listen on {}:{}: {}", address.host, address.port,
                                                errno == 0 ? "the name is unknown" : std::strerror(errno)));
    }
    // evhttp's own argument is the evhttp.
    evconnlistener_set_error_cb(evhttp_bound_socket_get_listener(bound_), [](evconnlistener* listener, void* /*http*/) {
      spdlog::warn("http: cannot accept a connection: {}", std::strerror(errno));
      evconnlistener_disable(listener);  // the loop would do nothing else than try it again
    });
    address_ = fmt::format("{}:{}", address.host, PortOf(evhttp_bound_socket_get_fd(bound_)));
    return absl::OkStatus();
  }

  bufferevent* NewConnection() {
    bufferevent* connection =
        tls_ ? tls_->NewConnection(loop_.base()) : bufferevent_socket_new(loop_.base(), -1, /*options=*/0);
    const bool is_usable = connection != nullptr;
    // Without memory for TLS: evhttp would serve a connection without TLS instead.
    if (!is_usable) connection = bufferevent_socket_new(loop_.base(), -1, /*options=*/0);
    if (connection == nullptr) return nullptr;
    guard_.Add(connection, is_usable);
    loop_.Post([this] { guard_.Inspect(); });
    return connection;
  }

  void OnRequest(evhttp_request* raw) {
    auto exchange = std::make_unique<Exchange>(raw, &host_);
    absl::StatusOr<HttpRequest> request = ReadRequest(raw);
    const absl::Status status = request.ok() ? CheckRequest(*request, is_loopback_) : request.status();
    if (!status.ok()) return exchange->Respond(ErrorResponse(status));
    if (!viewers_ || !feeds_) return exchange->Respond(ErrorResponse(ShuttingDown()));
    spdlog::debug("http: {}", Printable(request->path));
    if (request->path == "/metrics") return RespondFromWorker(std::move(exchange), *std::move(request), std::nullopt);
    if (!request->path.starts_with("/api/")) {
      if (request->method == Method::kGet) {
        return exchange->Respond(AssetResponse(options_.assets, request->path, request->accepts_gzip));
      }
      return exchange->Respond(ErrorResponse(NotFound("there is no such resource; see server/http/README.md")));
    }
    const absl::StatusOr<Route> route = ParseRoute(request->method, request->path);
    if (!route.ok()) return exchange->Respond(ErrorResponse(route.status()));
    if (route->resource == Resource::kFrames) {
      return feeds_->Post(route->session_id, *std::move(request), std::move(exchange));
    }
    if (route->resource == Resource::kEvents) return OpenStream(std::move(exchange), *request, route->session_id);
    RespondFromWorker(std::move(exchange), *std::move(request), *route);
  }

  // `route`: nullopt for the metrics.
  void RespondFromWorker(std::unique_ptr<Exchange> exchange, HttpRequest request, std::optional<Route> route) {
    std::shared_ptr<Exchange> shared = std::move(exchange);  // used and deleted on the loop's thread
    const bool is_submitted = pool_.Submit([this, shared, request = std::move(request), route] {
      HttpResponse response = route ? api_.Respond(*route, request) : MetricsResponse(request);
      loop_.Post([shared, response = std::move(response)] { shared->Respond(response); });
    });
    if (!is_submitted) shared->Respond(ErrorResponse(TooManyCalls()));
  }

  HttpResponse MetricsResponse(const HttpRequest& request) const {
    const absl::StatusOr<access::Caller> caller = authenticator_.Authenticate(request.authorization);
    if (!caller.ok()) return ErrorResponse(caller.status());
    if (!caller->is_admin) {
      return ErrorResponse(absl::PermissionDeniedError("the metrics need a token with the role admin"));
    }
    const auto sessions = caller->service->ListSessions();
    if (!sessions.ok()) return ErrorResponse(sessions.status());
    return TextResponse("text/plain; version=0.0.4; charset=utf-8", metrics_.Text(*sessions));
  }

  void OpenStream(std::unique_ptr<Exchange> exchange, const HttpRequest& request, const std::string& session_id) {
    absl::StatusOr<ViewerOptions> options = ParseViewerOptions(session_id, request.query);
    if (!options.ok()) return exchange->Respond(ErrorResponse(options.status()));
    if (viewers_->size() + opening_viewers_ >= static_cast<size_t>(options_.config.max_viewers)) {
      return exchange->Respond(ErrorResponse(absl::ResourceExhaustedError(
          fmt::format("the limit of {} viewers (http.max_viewers) is reached", options_.config.max_viewers))));
    }
    ++opening_viewers_;
    std::shared_ptr<Exchange> shared = std::move(exchange);
    const bool is_submitted =
        pool_.Submit([this, shared, options = *std::move(options), authorization = request.authorization] {
          absl::StatusOr<access::Caller> caller = authenticator_.Authenticate(authorization);
          absl::StatusOr<std::unique_ptr<EventStream>> stream =
              caller.ok() ? caller->service->Watch(options.session_id) : caller.status();
          auto opened = std::make_shared<decltype(stream)>(std::move(stream));
          loop_.Post([this, shared, options, caller, opened] { OnOpened(shared, caller, options, *opened); });
        });
    if (is_submitted) return;
    --opening_viewers_;
    shared->Respond(ErrorResponse(TooManyCalls()));
  }

  void OnOpened(const std::shared_ptr<Exchange>& exchange, const absl::StatusOr<access::Caller>& caller,
                const ViewerOptions& options, absl::StatusOr<std::unique_ptr<EventStream>>& stream) {
    --opening_viewers_;
    if (!stream.ok()) return exchange->Respond(ErrorResponse(stream.status()));
    if (!viewers_) return exchange->Respond(ErrorResponse(ShuttingDown()));
    viewers_->Add(exchange, *caller, options, *std::move(stream));
  }

  const access::Authenticator& authenticator_;
  const Options options_;
  Metrics metrics_;
  MeshCache meshes_;
  const Api api_;
  std::unique_ptr<TlsContext> tls_;
  bool is_loopback_ = true;
  std::string address_;
  bool is_running_ = false;

  EventLoop loop_;
  // On the loop's thread.
  ConnectionGuard guard_;
  ExchangeHost host_;
  std::unique_ptr<evhttp, void (*)(evhttp*)> http_;
  evhttp_bound_socket* bound_ = nullptr;
  size_t opening_viewers_ = 0;

  WorkerPool pool_;
  std::optional<Viewers> viewers_;
  std::optional<FrameFeeds> feeds_;
};

absl::StatusOr<std::unique_ptr<HttpServer>> HttpServer::Start(const access::Authenticator* authenticator,
                                                              Options options) {
  try {
    auto impl = std::make_unique<Impl>(authenticator, std::move(options));
    ROMAP_RETURN_IF_ERROR(impl->Start());
    return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
  } catch (const std::exception& e) {
    return absl::ResourceExhaustedError(fmt::format("the HTTP server cannot be started: {}", e.what()));
  }
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
HttpServer::~HttpServer() { Shutdown(); }
const std::string& HttpServer::address() const { return impl_->address(); }
std::string HttpServer::url() const { return impl_->url(); }
void HttpServer::Shutdown() { impl_->Shutdown(); }

}  // namespace romap::http
