#include "server/transport/malformed_requests.h"

#include <fmt/format.h>
#include <grpcpp/support/status.h>

#include <string>
#include <utility>

namespace romap::transport {
namespace {

using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::InterceptorBatchMethods;
using grpc::experimental::ServerRpcInfo;

class StatusOfMalformedRequest : public grpc::experimental::Interceptor {
 public:
  explicit StatusOfMalformedRequest(std::string call) : call_(std::move(call)) {}

  void Intercept(InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS)) {
      const grpc::Status status = methods->GetSendStatus();
      // All calls of the service exist, and its own errors have a text.
      if (status.error_code() == grpc::StatusCode::UNIMPLEMENTED && status.error_message().empty()) {
        methods->ModifySendStatus({grpc::StatusCode::INVALID_ARGUMENT,
                                   fmt::format("{}: the request is not a valid message of its type", call_)});
      }
    }
    methods->Proceed();
  }

 private:
  const std::string call_;  // /PACKAGE.SERVICE/METHOD
};

}  // namespace

grpc::experimental::Interceptor* MalformedRequests::CreateServerInterceptor(ServerRpcInfo* info) {
  const bool is_one_request =
      info->type() == ServerRpcInfo::Type::UNARY || info->type() == ServerRpcInfo::Type::SERVER_STREAMING;
  return is_one_request ? new StatusOfMalformedRequest(info->method()) : nullptr;  // gRPC takes ownership
}

}  // namespace romap::transport
