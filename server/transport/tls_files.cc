#include "server/transport/tls_files.h"

#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <openssl/bio.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include "common/file_status.h"
#include "common/status.h"

namespace romap::transport {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kWatchPeriod{1};
constexpr unsigned kGrpcRefreshPeriod_s = 1;

using Bio = std::unique_ptr<BIO, decltype(&BIO_free)>;
using Certificate = std::unique_ptr<X509, decltype(&X509_free)>;
using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;

Bio MakeBio(const std::string& text) { return {BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), BIO_free}; }

// The first certificate; null: there is none.
Certificate ParseCertificate(const std::string& pem) {
  const Bio bio = MakeBio(pem);
  return {PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr), X509_free};
}

// Encrypted keys are not supported, because nobody could enter the password.
Key ParseKey(const std::string& pem) {
  const Bio bio = MakeBio(pem);
  return {PEM_read_bio_PrivateKey(
              bio.get(), nullptr, [](char*, int, int, void*) { return -1; }, nullptr),
          EVP_PKEY_free};
}

absl::StatusOr<std::string> ReadText(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return FileError(path, "read");
  return std::string(std::istreambuf_iterator<char>(stream), {});
}

absl::Status WriteText(const fs::path& path, const std::string& text) {
  std::ofstream stream(path, std::ios::binary);
  stream << text;
  stream.close();
  return stream ? absl::OkStatus() : FileError(path.string(), "write");
}

}  // namespace

absl::StatusOr<std::unique_ptr<TlsFiles>> TlsFiles::Load(const TransportConfig& config) {
  if (config.tls_certificate.empty() || config.tls_key.empty()) {
    return InvalidArgument("TLS needs both transport.tls_certificate and transport.tls_key");
  }
  std::unique_ptr<TlsFiles> files(new TlsFiles(config));
  ROMAP_ASSIGN_OR_RETURN(const Contents contents, files->Read());
  ROMAP_RETURN_IF_ERROR(files->Check(contents));
  std::string pattern = (fs::temp_directory_path() / "romap-tls-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) return FileError(pattern, "create the folder");  // its mode is 0700
  files->folder_ = pattern;
  ROMAP_RETURN_IF_ERROR(files->Install(contents));
  files->thread_ = std::thread([watching = files.get()] { watching->Watch(); });
  return files;
}

TlsFiles::~TlsFiles() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
    stopping_changed_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
  std::error_code ignored;
  if (!folder_.empty()) fs::remove_all(folder_, ignored);
}

std::shared_ptr<grpc::ServerCredentials> TlsFiles::Credentials() const {
  using grpc::experimental::FileWatcherCertificateProvider;
  const std::string current = folder_ + "/current/";
  const bool checks_clients = !config_.tls_client_ca.empty();
  // The three paths are in one folder, which changes as a whole.
  const auto provider = std::make_shared<FileWatcherCertificateProvider>(
      current + "key.pem", current + "certificate.pem", checks_clients ? current + "client_ca.pem" : "",
      kGrpcRefreshPeriod_s);
  grpc::experimental::TlsServerCredentialsOptions options(provider);
  options.watch_identity_key_cert_pairs();
  if (checks_clients) {
    options.watch_root_certs();
    options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  } else {
    options.set_cert_request_type(GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE);
  }
  return grpc::experimental::TlsServerCredentials(options);
}

std::shared_ptr<const TlsFiles::Contents> TlsFiles::installed() const {
  std::lock_guard lock(mutex_);
  return installed_;
}

absl::StatusOr<TlsFiles::Contents> TlsFiles::Read() const {
  Contents contents;
  ROMAP_ASSIGN_OR_RETURN(contents.certificate, ReadText(config_.tls_certificate));
  ROMAP_ASSIGN_OR_RETURN(contents.key, ReadText(config_.tls_key));
  if (!config_.tls_client_ca.empty()) {
    ROMAP_ASSIGN_OR_RETURN(contents.client_ca, ReadText(config_.tls_client_ca));
  }
  return contents;
}

absl::Status TlsFiles::Check(const Contents& contents) const {
  const Certificate certificate = ParseCertificate(contents.certificate);
  if (!certificate) return InvalidArgument("{}: has no certificate in PEM format", config_.tls_certificate);
  const Key key = ParseKey(contents.key);
  if (!key) return InvalidArgument("{}: has no private key in PEM format without password", config_.tls_key);
  if (X509_check_private_key(certificate.get(), key.get()) != 1) {
    return InvalidArgument("{}: is not the key of the certificate in {}", config_.tls_key, config_.tls_certificate);
  }
  if (X509_cmp_current_time(X509_get0_notAfter(certificate.get())) < 0) {
    return InvalidArgument("{}: the certificate has expired", config_.tls_certificate);
  }
  if (!config_.tls_client_ca.empty() && !ParseCertificate(contents.client_ca)) {
    return InvalidArgument("{}: has no certificate in PEM format", config_.tls_client_ca);
  }
  return absl::OkStatus();
}

absl::Status TlsFiles::Install(const Contents& contents) {
  const std::string name = std::to_string(++version_);
  const fs::path folder = fs::path(folder_) / name, current = fs::path(folder_) / "current";
  std::error_code error;
  fs::create_directory(folder, error);
  ROMAP_RETURN_IF_ERROR(WriteText(folder / "certificate.pem", contents.certificate));
  ROMAP_RETURN_IF_ERROR(WriteText(folder / "key.pem", contents.key));
  if (!contents.client_ca.empty()) ROMAP_RETURN_IF_ERROR(WriteText(folder / "client_ca.pem", contents.client_ca));
  fs::create_directory_symlink(name, fs::path(folder_) / "next", error);
  if (!error) fs::rename(fs::path(folder_) / "next", current, error);
  if (error) return FileError(current.string(), "replace", error);
  fs::remove_all(fs::path(folder_) / std::to_string(version_ - 2), error);  // gRPC may still read the last one
  installed_ = std::make_shared<const Contents>(contents);
  return absl::OkStatus();
}

// Files are compared by their contents, because tools that renew certificates keep or set times as they like.
void TlsFiles::Watch() {
  std::unique_lock lock(mutex_);
  while (!stopping_changed_.wait_for(lock, kWatchPeriod, [&] { return stopping_; })) {
    const absl::StatusOr<Contents> contents = Read();
    // A missing file is probably about to be written.
    if (!contents.ok() || *contents == *installed_ || *contents == rejected_) continue;
    absl::Status status = Check(*contents);
    if (status.ok()) status = Install(*contents);
    if (status.ok()) {
      spdlog::info("TLS: the certificate was replaced");
    } else {
      rejected_ = *contents;
      spdlog::warn("TLS: the new certificate is not used: {}", Message(status));
    }
  }
}

}  // namespace romap::transport
