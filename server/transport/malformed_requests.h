#pragma once

#include <grpcpp/support/server_interceptor.h>

namespace romap::transport {

// gRPC answers a request that is not a valid message with UNIMPLEMENTED and no text, as if the call did not exist. With
// this interceptor the answer is INVALID_ARGUMENT and says so. Not for calls whose requests are a stream: the reactor
// reads those.
class MalformedRequests : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  grpc::experimental::Interceptor* CreateServerInterceptor(grpc::experimental::ServerRpcInfo* info) override;
};

}  // namespace romap::transport
