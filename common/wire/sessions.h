#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "common/mapping_service.h"
#include "romap/v1/mapping.pb.h"

namespace romap::wire {

// FromProto answers INVALID_ARGUMENT "<field>: ..." to a missing camera, an unknown enum value or an impossible number.

v1::CreateSessionRequest ToProto(const SessionOptions& options);
absl::StatusOr<SessionOptions> FromProto(const v1::CreateSessionRequest& proto);

v1::SessionInfo ToProto(const SessionInfo& info);
absl::StatusOr<SessionInfo> FromProto(const v1::SessionInfo& proto, const std::string& where);

// The parts of an export in the order they are sent: header, objects, pieces of the trajectory. Each is far below the
// message limit; only a single mesh could outgrow it.
std::vector<v1::ExportMapResponse> ToProto(MapSnapshot snapshot);

// Puts the parts of an export together again.
class SnapshotAssembler {
 public:
  // INVALID_ARGUMENT when the part is malformed or out of order. A kind of part that is not known here is skipped.
  absl::Status Add(v1::ExportMapResponse part);
  // INVALID_ARGUMENT when the header never came. Call once, after the last part.
  absl::StatusOr<MapSnapshot> Take();

 private:
  MapSnapshot snapshot_;
  bool has_header_ = false;
};

}  // namespace romap::wire
