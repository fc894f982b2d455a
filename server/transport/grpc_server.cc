#include "server/transport/grpc_server.h"

#include <google/protobuf/stubs/logging.h>
#include <grpc/support/log.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/host_port.h"
#include "common/status.h"
#include "server/transport/call_host.h"
#include "server/transport/listener.h"
#include "server/transport/malformed_requests.h"
#include "server/transport/mapping_rpcs.h"
#include "server/transport/tls_files.h"

namespace romap::transport {
namespace {

using std::chrono::system_clock;

// A client without calls is disconnected after this time. Its channel connects again when it makes a call.
constexpr double kIdle_s = 60;

bool UsesTls(const TransportConfig& config) {
  return !config.tls_certificate.empty() || !config.tls_key.empty() || !config.tls_client_ca.empty();
}

int Milliseconds(double seconds) { return static_cast<int>(1000 * seconds); }

void Configure(grpc::ServerBuilder& builder, const TransportConfig& config) {
  builder.SetMaxReceiveMessageSize(config.max_message_bytes);
  builder.SetMaxSendMessageSize(config.max_message_bytes);
  builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, Milliseconds(config.handshake_timeout_s));
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, Milliseconds(kIdle_s));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, Milliseconds(config.keepalive_s));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, Milliseconds(config.keepalive_s));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  // Clients send keepalive pings too. By default gRPC disconnects clients that ping more often than every 5 minutes.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 1000);
}

}  // namespace

class GrpcServer::Impl {
 public:
  Impl(const access::Authenticator* authenticator, const TransportConfig& config)
      : config_(config), host_(authenticator, config.max_calls), rpcs_(&host_, FirstRequestTimeout()) {}
  Impl(std::unique_ptr<access::Authenticator> authenticator, const TransportConfig& config)
      : own_authenticator_(std::move(authenticator)),
        config_(config),
        host_(own_authenticator_.get(), config.max_calls),
        rpcs_(&host_, FirstRequestTimeout()) {}

  absl::Status Start() {
    const std::optional<HostPort> address = ParseHostPort(config_.listen_address);
    if (!address) {
      return InvalidArgument("transport.listen_address: must be HOST:PORT, e.g. 127.0.0.1:50051, is '{}'",
                             config_.listen_address);
    }
    ROMAP_ASSIGN_OR_RETURN(const auto credentials, MakeCredentials());
    ROMAP_ASSIGN_OR_RETURN(listener_, Listener::Open(*address));
    // Both are process-wide settings that must be set before the first server is built.
    grpc::EnableDefaultHealthCheckService(true);
    if (config_.reflection && IsLoopback(*address)) grpc::reflection::InitProtoReflectionServerBuilderPlugin();

    grpc::ServerBuilder builder;
    Configure(builder, config_);
    using FromListener = grpc::ServerBuilder::experimental_type::ExternalConnectionType;
    acceptor_ = builder.experimental().AddExternalConnectionAcceptor(FromListener::FROM_FD, credentials);
    builder.RegisterService(&rpcs_);
    std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> interceptors;
    interceptors.push_back(std::make_unique<MalformedRequests>());
    builder.experimental().SetInterceptorCreators(std::move(interceptors));
    server_ = builder.BuildAndStart();
    if (!server_) return absl::UnavailableError("gRPC cannot start a server");
    address_ = fmt::format("{}:{}", address->host, listener_->port());
    listener_->Start(WithinFileLimit({.total = config_.max_connections, .per_peer = config_.max_connections_per_peer}),
                     [this](int fd) {
                       grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters connection;
                       connection.fd = fd;
                       acceptor_->HandleNewConnection(&connection);
                     });
    SetServing(true);
    return absl::OkStatus();
  }

  void Shutdown() {
    if (!server_) return;
    SetServing(false);
    listener_->Stop();
    host_.StopAll(absl::UnavailableError("the server is shutting down"));
    server_->Shutdown(system_clock::now() + std::chrono::milliseconds(Milliseconds(config_.shutdown_grace_s)));
    host_.JoinAll();
    server_.reset();
  }

  int port() const { return listener_->port(); }
  const std::string& address() const { return address_; }
  int OpenConnections() const { return listener_->OpenConnections(); }

 private:
  std::chrono::milliseconds FirstRequestTimeout() const {
    return std::chrono::milliseconds(Milliseconds(config_.handshake_timeout_s));
  }

  absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> MakeCredentials() {
    if (!UsesTls(config_)) return grpc::InsecureServerCredentials();
    ROMAP_ASSIGN_OR_RETURN(tls_, TlsFiles::Load(config_));
    return tls_->Credentials();
  }

  void SetServing(bool serving) {
    grpc::HealthCheckServiceInterface* health = server_->GetHealthCheckService();
    health->SetServingStatus(serving);
    health->SetServingStatus(v1::Mapping::service_full_name(), serving);
  }

  const std::unique_ptr<access::Authenticator> own_authenticator_;  // null: somebody else's is used
  const TransportConfig config_;
  CallHost host_;
  MappingRpcs rpcs_;
  std::unique_ptr<TlsFiles> tls_;
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> acceptor_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<Listener> listener_;  // its thread uses the acceptor
  std::string address_;
};

absl::StatusOr<std::unique_ptr<GrpcServer>> GrpcServer::Start(MappingService* service, const TransportConfig& config) {
  auto everybody = std::make_unique<access::Authenticator>(service, /*token_file=*/"", access::AccessConfig{});
  auto impl = std::make_unique<Impl>(std::move(everybody), config);
  ROMAP_RETURN_IF_ERROR(impl->Start());
  return std::unique_ptr<GrpcServer>(new GrpcServer(std::move(impl)));
}

absl::StatusOr<std::unique_ptr<GrpcServer>> GrpcServer::Start(const access::Authenticator* authenticator,
                                                              const TransportConfig& config) {
  auto impl = std::make_unique<Impl>(authenticator, config);
  ROMAP_RETURN_IF_ERROR(impl->Start());
  return std::unique_ptr<GrpcServer>(new GrpcServer(std::move(impl)));
}

GrpcServer::GrpcServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
GrpcServer::~GrpcServer() { Shutdown(); }

int GrpcServer::port() const { return impl_->port(); }
const std::string& GrpcServer::address() const { return impl_->address(); }
int GrpcServer::OpenConnections() const { return impl_->OpenConnections(); }
void GrpcServer::Shutdown() { impl_->Shutdown(); }

absl::Status CheckTlsFiles(const TransportConfig& config) {
  if (!UsesTls(config)) return absl::OkStatus();
  return TlsFiles::Load(config).status();
}

void RouteGrpcLogToSpdlog() {
  gpr_set_log_function([](gpr_log_func_args* args) { spdlog::debug("grpc: {}", args->message); });
  // Its own handler writes a line to stderr for every text of a request that is not UTF-8, and waits for who reads it.
  google::protobuf::SetLogHandler([](google::protobuf::LogLevel /*level*/, const char* /*file*/, int /*line*/,
                                     const std::string& message) { spdlog::debug("protobuf: {}", message); });
}

}  // namespace romap::transport
