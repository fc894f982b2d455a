#include "server/transport/grpc_server.h"

#include <grpc/support/log.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <spdlog/spdlog.h>

#include <charconv>
#include <chrono>
#include <optional>
#include <string_view>
#include <utility>

#include "common/status.h"
#include "server/transport/call_host.h"
#include "server/transport/mapping_rpcs.h"

namespace romap::transport {
namespace {

using std::chrono::system_clock;

struct HostPort {
  std::string_view host;
  int port = 0;
};

std::optional<HostPort> SplitHostPort(std::string_view address) {
  const size_t colon = address.rfind(':');
  if (colon == std::string_view::npos || colon == 0) return std::nullopt;
  const std::string_view digits = address.substr(colon + 1);
  HostPort result{.host = address.substr(0, colon)};
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), result.port);
  if (error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  if (result.port < 0 || result.port > 65535) return std::nullopt;
  return result;
}

int Milliseconds(double seconds) { return static_cast<int>(1000 * seconds); }

void Configure(grpc::ServerBuilder& builder, const TransportConfig& config) {
  builder.SetMaxReceiveMessageSize(config.max_message_bytes);
  builder.SetMaxSendMessageSize(config.max_message_bytes);
  // Otherwise two servers could listen on one port, and clients would reach either of them at random.
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, Milliseconds(config.keepalive_s));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, Milliseconds(config.keepalive_s));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  // Clients send keepalive pings too. By default gRPC disconnects clients that ping more often than every 5 minutes.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 1000);
}

}  // namespace

class GrpcServer::Impl {
 public:
  Impl(MappingService* service, const TransportConfig& config)
      : config_(config), host_(service, config.max_calls), rpcs_(&host_) {}

  absl::Status Start() {
    const std::optional<HostPort> host_port = SplitHostPort(config_.listen_address);
    if (!host_port) {
      return InvalidArgument("transport.listen_address: must be HOST:PORT, e.g. 127.0.0.1:50051, is '{}'",
                             config_.listen_address);
    }
    // Both are process-wide settings that must be set before the first server is built.
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();

    grpc::ServerBuilder builder;
    Configure(builder, config_);
    builder.AddListeningPort(config_.listen_address, grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(&rpcs_);
    server_ = builder.BuildAndStart();
    if (!server_ || port_ == 0) {
      return absl::UnavailableError(
          fmt::format("cannot listen on {}: the address is in use or not available", config_.listen_address));
    }
    address_ = fmt::format("{}:{}", host_port->host, port_);
    SetServing(true);
    return absl::OkStatus();
  }

  void Shutdown() {
    if (!server_) return;
    SetServing(false);
    host_.StopAll(absl::UnavailableError("the server is shutting down"));
    server_->Shutdown(system_clock::now() + std::chrono::milliseconds(Milliseconds(config_.shutdown_grace_s)));
    host_.JoinAll();
    server_.reset();
  }

  int port() const { return port_; }
  const std::string& address() const { return address_; }

 private:
  void SetServing(bool serving) {
    grpc::HealthCheckServiceInterface* health = server_->GetHealthCheckService();
    health->SetServingStatus(serving);
    health->SetServingStatus(v1::Mapping::service_full_name(), serving);
  }

  const TransportConfig config_;
  transport::CallHost host_;
  transport::MappingRpcs rpcs_;
  std::unique_ptr<grpc::Server> server_;
  int port_ = 0;
  std::string address_;
};

absl::StatusOr<std::unique_ptr<GrpcServer>> GrpcServer::Start(MappingService* service, const TransportConfig& config) {
  auto impl = std::make_unique<Impl>(service, config);
  ROMAP_RETURN_IF_ERROR(impl->Start());
  return std::unique_ptr<GrpcServer>(new GrpcServer(std::move(impl)));
}

GrpcServer::GrpcServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
GrpcServer::~GrpcServer() { Shutdown(); }

int GrpcServer::port() const { return impl_->port(); }
const std::string& GrpcServer::address() const { return impl_->address(); }
void GrpcServer::Shutdown() { impl_->Shutdown(); }

void RouteGrpcLogToSpdlog() {
  gpr_set_log_function([](gpr_log_func_args* args) { spdlog::debug("grpc: {}", args->message); });
}

}  // namespace romap::transport
