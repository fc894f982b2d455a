#include "server/http/exchange.h"

#include <absl/status/status.h>
#include <event2/buffer.h>
#include <event2/bufferevent.h>
#include <event2/http.h>

#include <memory>
#include <utility>

namespace romap::http {
namespace {

constexpr const char* kContentSecurityPolicy =
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; style-src 'self'; "
    "img-src 'self' blob: data:; connect-src 'self'; media-src 'self' blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";

// The part of a response that waits in the buffers of libevent, which deletes it when it was sent or the connection
// broke.
struct SentBody {
  std::shared_ptr<const void> owner;
  ExchangeHost* host;
  size_t size;

  SentBody(std::shared_ptr<const void> body_owner, ExchangeHost* exchange_host, size_t bytes)
      : owner(std::move(body_owner)), host(exchange_host), size(bytes) {
    host->sending_bytes += size;
  }
  ~SentBody() { host->sending_bytes -= size; }
  SentBody(const SentBody&) = delete;
  SentBody& operator=(const SentBody&) = delete;
};

using Buffer = std::unique_ptr<evbuffer, decltype(&evbuffer_free)>;

int DescriptorOf(evhttp_request* request) {
  evhttp_connection* connection = evhttp_request_get_connection(request);
  return connection == nullptr ? -1 : bufferevent_getfd(evhttp_connection_get_bufferevent(connection));
}

void AddCommonHeaders(evkeyvalq* headers) {
  evhttp_add_header(headers, "Content-Security-Policy", kContentSecurityPolicy);
  evhttp_add_header(headers, "X-Content-Type-Options", "nosniff");
  evhttp_add_header(headers, "Referrer-Policy", "no-referrer");
  if (evhttp_find_header(headers, "Cache-Control") == nullptr) evhttp_add_header(headers, "Cache-Control", "no-store");
}

}  // namespace

Exchange::Exchange(evhttp_request* request, ExchangeHost* host) : request_(request), host_(host) {
  host_->guard->OnRequest(Descriptor());
}

Exchange::~Exchange() {
  if (request_ == nullptr) return;
  if (is_stream_) {
    EndStream();
  } else {
    Respond(ErrorResponse(absl::UnavailableError("the server is shutting down")));
  }
}

int Exchange::Descriptor() const { return DescriptorOf(request_); }

void Exchange::Respond(const HttpResponse& response) {
  if (host_->sending_bytes + response.body.size() > host_->max_sending_bytes && response.body_owner &&
      response.code == 200) {
    return Respond(ErrorResponse(absl::ResourceExhaustedError("too many downloads at a time; try again later")));
  }
  evhttp_request* request = std::exchange(request_, nullptr);
  evkeyvalq* headers = evhttp_request_get_output_headers(request);
  evhttp_add_header(headers, "Content-Type", response.content_type.c_str());
  for (const auto& [name, value] : response.headers) evhttp_add_header(headers, name.c_str(), value.c_str());
  AddCommonHeaders(headers);
  const Buffer body(evbuffer_new(), evbuffer_free);
  if (response.body_owner) {
    auto* sent = new SentBody(response.body_owner, host_, response.body.size());
    const auto clean_up = [](const void*, size_t, void* owner) { delete static_cast<SentBody*>(owner); };
    if (evbuffer_add_reference(body.get(), response.body.data(), response.body.size(), clean_up, sent) != 0) {
      delete sent;
    }
  } else {
    evbuffer_add_reference(body.get(), response.body.data(), response.body.size(), nullptr, nullptr);
  }
  host_->count_response(response.code);
  host_->guard->OnResponse(DescriptorOf(request));
  evhttp_request_set_on_complete_cb(
      request,
      [](evhttp_request* sent, void* host) { static_cast<ExchangeHost*>(host)->guard->OnSent(DescriptorOf(sent)); },
      host_);
  evhttp_send_reply(request, response.code, nullptr, body.get());
}

void Exchange::BeginStream(std::string_view content_type, std::chrono::seconds max_stall) {
  is_stream_ = true;
  evkeyvalq* headers = evhttp_request_get_output_headers(request_);
  evhttp_add_header(headers, "Content-Type", std::string(content_type).c_str());
  AddCommonHeaders(headers);
  host_->count_response(200);
  host_->guard->OnStream(Descriptor());
  evhttp_send_reply_start(request_, 200, nullptr);
  if (!IsConnected()) return;
  const timeval stall{.tv_sec = max_stall.count(), .tv_usec = 0};
  bufferevent_set_timeouts(evhttp_connection_get_bufferevent(evhttp_request_get_connection(request_)), nullptr, &stall);
}

void Exchange::Write(std::string_view text) {
  const Buffer chunk(evbuffer_new(), evbuffer_free);
  evbuffer_add(chunk.get(), text.data(), text.size());
  evhttp_send_reply_chunk(request_, chunk.get());
}

void Exchange::EndStream() {
  evhttp_request* request = std::exchange(request_, nullptr);
  host_->guard->OnResponse(DescriptorOf(request));
  evhttp_request_set_on_complete_cb(
      request,
      [](evhttp_request* sent, void* host) { static_cast<ExchangeHost*>(host)->guard->OnSent(DescriptorOf(sent)); },
      host_);
  evhttp_send_reply_end(request);
}

bool Exchange::IsConnected() const { return evhttp_request_get_connection(request_) != nullptr; }

size_t Exchange::WaitingBytes() const {
  evhttp_connection* connection = evhttp_request_get_connection(request_);
  if (connection == nullptr) return 0;
  return evbuffer_get_length(bufferevent_get_output(evhttp_connection_get_bufferevent(connection)));
}

}  // namespace romap::http
