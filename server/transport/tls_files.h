#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <grpcpp/security/server_credentials.h>

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "server/transport/transport_config.h"

namespace romap::transport {

// The certificate and key of a server, read again when the files change. gRPC reads such files too, but one that does
// not fit the others makes every new handshake fail. Therefore gRPC gets copies in a private folder, which are replaced
// together, and only after the new files were found to belong together. Until then the old ones stay in use.
class TlsFiles {
 public:
  // INVALID_ARGUMENT: a file cannot be used; the message names it. Otherwise as FileError().
  static absl::StatusOr<std::unique_ptr<TlsFiles>> Load(const TransportConfig& config);
  ~TlsFiles();

  // PEM texts that belong together.
  struct Contents {
    std::string certificate, key, client_ca;  // the last one may be empty

    bool operator==(const Contents&) const = default;
  };

  std::shared_ptr<grpc::ServerCredentials> Credentials() const;
  // What is in use now, never null. Another object after every change.
  std::shared_ptr<const Contents> installed() const;

 private:
  explicit TlsFiles(const TransportConfig& config) : config_(config) {}
  absl::StatusOr<Contents> Read() const;
  absl::Status Check(const Contents& contents) const;
  absl::Status Install(const Contents& contents);
  void Watch();

  const TransportConfig config_;
  std::string folder_;  // private; its link `current` leads to the newest copies
  int version_ = 0;
  std::shared_ptr<const Contents> installed_;
  Contents rejected_;
  mutable std::mutex mutex_;
  std::condition_variable stopping_changed_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace romap::transport
