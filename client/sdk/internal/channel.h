#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "client/sdk/remote_mapping_service.h"

namespace romap::client {

// A channel to a server, not yet connected, whose calls carry the token. INVALID_ARGUMENT: the token would be sent in
// clear text to another machine. As FileError() for a TLS file.
absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeChannel(const std::string& host_port, const RemoteOptions& options);

}  // namespace romap::client
