#pragma once

#include <absl/status/status.h>
#include <grpcpp/support/status.h>

#include "common/status.h"

namespace romap::wire {

// Both libraries use the same code numbers.

inline grpc::Status ToGrpc(const absl::Status& status) {
  return status.ok() ? grpc::Status::OK : grpc::Status(static_cast<grpc::StatusCode>(status.code()), Message(status));
}

inline absl::Status FromGrpc(const grpc::Status& status) {
  return status.ok() ? absl::OkStatus()
                     : absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
}

}  // namespace romap::wire
