#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <string_view>

#include "server/http/connection_guard.h"
#include "server/http/message.h"

struct evhttp_request;

namespace romap::http {

// What all exchanges of a server share; outlives them.
struct ExchangeHost {
  ConnectionGuard* guard = nullptr;
  std::function<void(int code)> count_response;
  size_t max_sending_bytes = size_t{256} << 20;
  size_t sending_bytes = 0;  // of the responses that clients have not read yet
};

// One request and its response: either Respond(), or a stream from BeginStream() to EndStream(). On the loop's thread.
// The connection may break at any time; then the response is discarded.
class Exchange {
 public:
  // `request` belongs to evhttp, which frees it after the response.
  Exchange(evhttp_request* request, ExchangeHost* host);
  ~Exchange();  // ends the stream; without a response, responds with UNAVAILABLE
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;

  void Respond(const HttpResponse& response);

  void BeginStream(std::string_view content_type, std::chrono::seconds max_stall);
  void Write(std::string_view text);
  void EndStream();
  // False: the client has disconnected.
  bool IsConnected() const;
  // What the client has not read yet, without what the system holds.
  size_t WaitingBytes() const;

 private:
  int Descriptor() const;

  evhttp_request* request_;  // null: it was answered
  ExchangeHost* const host_;
  bool is_stream_ = false;
};

}  // namespace romap::http
