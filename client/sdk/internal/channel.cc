#include "client/sdk/internal/channel.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/channel_arguments.h>
#include <grpcpp/support/client_interceptor.h>

#include <fstream>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "common/file_status.h"
#include "common/host_port.h"
#include "common/status.h"

namespace romap::client {
namespace {

// Adds the token to every call. gRPC's own call credentials exist only for TLS.
class TokenInterceptor : public grpc::experimental::Interceptor {
 public:
  explicit TokenInterceptor(std::string authorization) : authorization_(std::move(authorization)) {}

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(grpc::experimental::InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      methods->GetSendInitialMetadata()->emplace("authorization", authorization_);
    }
    methods->Proceed();
  }

 private:
  const std::string authorization_;
};

class TokenInterceptorFactory : public grpc::experimental::ClientInterceptorFactoryInterface {
 public:
  explicit TokenInterceptorFactory(const std::string& token) : authorization_("Bearer " + token) {}
  grpc::experimental::Interceptor* CreateClientInterceptor(grpc::experimental::ClientRpcInfo* /*info*/) override {
    return new TokenInterceptor(authorization_);  // gRPC deletes it
  }

 private:
  const std::string authorization_;
};

grpc::ChannelArguments MakeChannelArguments(const RemoteOptions& options) {
  constexpr int kKeepalive_ms = 20'000;
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(options.max_message_bytes);
  arguments.SetMaxSendMessageSize(options.max_message_bytes);
  // Detects a server that disappears without closing the connection (power or network failure).
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepalive_ms);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepalive_ms);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // Connects quickly to a server that is still starting.
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
  // The global pool would share reconnect backoff with other channels to the same address.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  if (!options.tls.server_name.empty()) arguments.SetSslTargetNameOverride(options.tls.server_name);
  return arguments;
}

absl::StatusOr<std::string> ReadPem(const std::string& path) {
  if (path.empty()) return std::string();
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return FileError(path, "read");
  return std::string(std::istreambuf_iterator<char>(stream), {});
}

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> MakeCredentials(const TlsOptions& tls) {
  if (!tls.enabled) return grpc::InsecureChannelCredentials();
  if (tls.certificate.empty() != tls.key_file.empty()) {
    return InvalidArgument("TLS: a client certificate needs both the certificate and its key");
  }
  grpc::SslCredentialsOptions options;
  ROMAP_ASSIGN_OR_RETURN(options.pem_root_certs, ReadPem(tls.ca_file));
  ROMAP_ASSIGN_OR_RETURN(options.pem_cert_chain, ReadPem(tls.certificate));
  ROMAP_ASSIGN_OR_RETURN(options.pem_private_key, ReadPem(tls.key_file));
  return grpc::SslCredentials(options);
}

bool StaysOnThisMachine(const std::string& host_port) {
  const std::optional<HostPort> address = ParseHostPort(host_port);
  return host_port.starts_with("unix:") || (address && IsLoopback(*address));
}

}  // namespace

absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeChannel(const std::string& host_port, const RemoteOptions& options) {
  if (!options.token.empty() && !options.tls.enabled && !StaysOnThisMachine(host_port)) {
    return InvalidArgument("the token is not sent to {} in clear text; connect with TLS", host_port);
  }
  ROMAP_ASSIGN_OR_RETURN(const auto credentials, MakeCredentials(options.tls));
  std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>> interceptors;
  if (!options.token.empty()) interceptors.push_back(std::make_unique<TokenInterceptorFactory>(options.token));
  return grpc::experimental::CreateCustomChannelWithInterceptors(host_port, credentials, MakeChannelArguments(options),
                                                                 std::move(interceptors));
}

}  // namespace romap::client
