#pragma once

#include <memory>
#include <string>

namespace romap::testing_support {

// A certificate and its private key, PEM.
struct CertificatePair {
  std::string certificate, key;
};

// A certificate authority for tests of TLS. Its certificates are valid for localhost and 127.0.0.1.
class TestAuthority {
 public:
  TestAuthority();
  ~TestAuthority();

  const std::string& certificate() const { return certificate_; }
  // `days`: until it expires; negative: it has expired.
  CertificatePair Issue(int days = 1) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  std::string certificate_;
};

}  // namespace romap::testing_support
