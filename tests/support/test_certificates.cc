#include "tests/support/test_certificates.h"

#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include <cstdlib>
#include <random>

namespace romap::testing_support {
namespace {

using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;
using Certificate = std::unique_ptr<X509, decltype(&X509_free)>;

Key MakeKey() { return {EVP_EC_gen("P-256"), EVP_PKEY_free}; }

template <class Write>
std::string ToPem(const Write& write) {
  const std::unique_ptr<BIO, decltype(&BIO_free)> bio(BIO_new(BIO_s_mem()), BIO_free);
  write(bio.get());
  char* data = nullptr;
  const long bytes = BIO_get_mem_data(bio.get(), &data);
  return {data, static_cast<size_t>(bytes)};
}

void AddExtension(X509* certificate, int nid, const char* value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, certificate, certificate, nullptr, nullptr, 0);
  X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, &context, nid, value);
  X509_add_ext(certificate, extension, -1);
  X509_EXTENSION_free(extension);
}

// `issuer`, `issuer_key`: null: it signs itself.
Certificate MakeCertificate(EVP_PKEY* key, const char* name, int days, const X509* issuer, EVP_PKEY* issuer_key) {
  constexpr long kDay_s = 86400;
  Certificate certificate(X509_new(), X509_free);
  X509_set_version(certificate.get(), 2);
  ASN1_INTEGER_set(X509_get_serialNumber(certificate.get()), static_cast<long>(std::random_device{}() >> 1));
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), -2 * kDay_s);
  X509_gmtime_adj(X509_getm_notAfter(certificate.get()), days * kDay_s);
  X509_set_pubkey(certificate.get(), key);
  X509_NAME* subject = X509_get_subject_name(certificate.get());
  X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC, reinterpret_cast<const unsigned char*>(name), -1, -1, 0);
  X509_set_issuer_name(certificate.get(), issuer == nullptr ? subject : X509_get_subject_name(issuer));
  AddExtension(certificate.get(), NID_basic_constraints, issuer == nullptr ? "critical,CA:TRUE" : "CA:FALSE");
  if (issuer != nullptr) AddExtension(certificate.get(), NID_subject_alt_name, "DNS:localhost,IP:127.0.0.1");
  X509_sign(certificate.get(), issuer == nullptr ? key : issuer_key, EVP_sha256());
  return certificate;
}

std::string ToPem(const Certificate& certificate) {
  return ToPem([&](BIO* bio) { PEM_write_bio_X509(bio, certificate.get()); });
}

}  // namespace

struct TestAuthority::Impl {
  Key key = MakeKey();
  Certificate certificate = MakeCertificate(key.get(), "test authority", 2, nullptr, nullptr);
};

TestAuthority::TestAuthority() : impl_(std::make_unique<Impl>()), certificate_(ToPem(impl_->certificate)) {}
TestAuthority::~TestAuthority() = default;

CertificatePair TestAuthority::Issue(int days) const {
  const Key key = MakeKey();
  const Certificate certificate =
      MakeCertificate(key.get(), "localhost", days, impl_->certificate.get(), impl_->key.get());
  return {ToPem(certificate),
          ToPem([&](BIO* bio) { PEM_write_bio_PrivateKey(bio, key.get(), nullptr, nullptr, 0, nullptr, nullptr); })};
}

}  // namespace romap::testing_support
