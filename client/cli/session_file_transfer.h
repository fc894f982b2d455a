#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>

#include "common/mapping_service.h"

namespace romap::cli {

// Saves a session of a server as a file (*.romap). The file appears when it is complete.
absl::Status SaveSessionFile(MappingService& service, const std::string& session_id, const std::string& path);

// Adds the session of a file to a server, with another id.
absl::StatusOr<SessionInfo> LoadSessionFile(MappingService& service, const std::string& path);

// Copies a session on its server, through a temporary file.
absl::StatusOr<SessionInfo> CopySession(MappingService& service, const std::string& session_id);

}  // namespace romap::cli
