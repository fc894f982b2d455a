#include "server/access/authenticator.h"

#include <gmock/gmock.h>

#include <filesystem>

#include "common/status.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::access::authenticator_test {

using absl::StatusCode;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using testing_support::SmallCamera;

class AuthenticatorTest : public ::testing::Test {
 protected:
  std::shared_ptr<MappingService> ServiceOf(const std::string& tenant, Role role) {
    const std::string token = tokens_.Create("a", tenant, role).value();
    return authenticator_.Authenticate("Bearer " + token).value().service;
  }
  static AccessConfig TwoSessions() {
    AccessConfig config;
    config.max_sessions_per_tenant = 2;
    return config;
  }
  static std::string NewSession(MappingService& service) {
    return service.CreateSession({.name = "", .camera = SmallCamera()}).value().id;
  }

  testing_support::TemporaryFolder folder_;
  std::string path_ = folder_ / "tokens.json";
  testing_support::FakeMappingService fake_;
  TokenStore tokens_{path_};
  Authenticator authenticator_{&fake_, path_, TwoSessions()};
};

TEST_F(AuthenticatorTest, WithoutTokensEverybodyMayDoEverything) {
  const auto caller = authenticator_.Authenticate("");
  ASSERT_TRUE(caller.status().ok());
  EXPECT_OK(caller->service->CreateSession({.name = "", .camera = SmallCamera()}).status());
  EXPECT_TRUE(caller->is_valid());
  tokens_.Create("a", "lab", Role::kOwner).value();
  EXPECT_FALSE(caller->is_valid()) << "the first token ends it";
  EXPECT_CODE(authenticator_.Authenticate("").status(), StatusCode::kUnauthenticated);
}

TEST_F(AuthenticatorTest, ALostFileDoesNotOpenTheServer) {
  const std::string token = tokens_.Create("a", "lab", Role::kOwner).value();
  EXPECT_OK(authenticator_.Authenticate("Bearer " + token).status());
  std::filesystem::remove(path_);
  EXPECT_CODE(authenticator_.Authenticate("Bearer " + token).status(), StatusCode::kUnauthenticated);
  EXPECT_CODE(authenticator_.Authenticate("").status(), StatusCode::kUnauthenticated);
}

TEST_F(AuthenticatorTest, OnlyValidTokensAreAccepted) {
  const std::string token = tokens_.Create("a", "lab", Role::kOwner).value();
  for (const std::string& text : {token, "bearer " + token, "Bearer  " + token, std::string("Bearer "),
                                  std::string("Basic dTpw"), "Bearer " + token + " "}) {
    const auto caller = authenticator_.Authenticate(text);
    EXPECT_CODE(caller.status(), StatusCode::kUnauthenticated);
    EXPECT_THAT(Message(caller.status()), ::testing::Not(HasSubstr(token)));
  }
}

TEST_F(AuthenticatorTest, ARevokedCallerIsNotValid) {
  const std::string token = tokens_.Create("a", "lab", Role::kOwner).value();
  const auto caller = authenticator_.Authenticate("Bearer " + token);
  EXPECT_TRUE(caller->is_valid());
  EXPECT_OK(tokens_.Revoke(tokens_.List()->at(0).id));
  EXPECT_FALSE(caller->is_valid());
}

TEST_F(AuthenticatorTest, SessionsOfOtherTenantsDoNotExist) {
  const auto lab = ServiceOf("lab", Role::kOwner), office = ServiceOf("office", Role::kOwner);
  const auto admin = ServiceOf("ops", Role::kAdmin);
  const std::string id = NewSession(*lab);
  EXPECT_EQ(lab->GetSession(id)->tenant, "lab");
  EXPECT_THAT(lab->ListSessions().value(), SizeIs(1));
  EXPECT_THAT(admin->ListSessions().value(), SizeIs(1));
  EXPECT_THAT(office->ListSessions().value(), SizeIs(0));
  const absl::Status missing = office->GetSession("nosuchsession").status();
  EXPECT_CODE(missing, StatusCode::kNotFound);
  for (const absl::Status& status :
       {office->GetSession(id).status(), office->FinishSession(id).status(), office->DeleteSession(id),
        office->OpenMap(id).status(), office->Watch(id).status(), office->ExportMap(id).status(),
        office->PinSession(id, true).status(),
        office->SaveSession(id, [](const std::string&) { return absl::OkStatus(); })}) {
    EXPECT_CODE(status, StatusCode::kNotFound);
    EXPECT_EQ(Message(status), "session '" + id + "' does not exist");
  }
  EXPECT_OK(lab->OpenMap(id).status());
  EXPECT_OK(admin->DeleteSession(id));
}

TEST_F(AuthenticatorTest, AViewerReadsAndChangesNothing) {
  const auto owner = ServiceOf("lab", Role::kOwner), viewer = ServiceOf("lab", Role::kViewer);
  const std::string id = NewSession(*owner);
  EXPECT_OK(viewer->GetSession(id).status());
  EXPECT_OK(viewer->Watch(id).status());
  EXPECT_OK(viewer->ExportMap(id).status());
  for (const absl::Status& status :
       {viewer->CreateSession({.name = "", .camera = SmallCamera()}).status(), viewer->FinishSession(id).status(),
        viewer->DeleteSession(id), viewer->OpenMap(id).status(), viewer->PinSession(id, true).status(),
        viewer->LoadSession([] { return std::string(); }).status()}) {
    EXPECT_CODE(status, StatusCode::kPermissionDenied);
    EXPECT_THAT(Message(status), HasSubstr("needs a token with the role owner; this one has the role viewer"));
  }
}

TEST_F(AuthenticatorTest, ATenantHasALimitedNumberOfSessions) {
  const auto lab = ServiceOf("lab", Role::kOwner), office = ServiceOf("office", Role::kOwner);
  const std::string first = NewSession(*lab);
  NewSession(*lab);
  const absl::Status refused = lab->CreateSession({.name = "", .camera = SmallCamera()}).status();
  EXPECT_CODE(refused, StatusCode::kResourceExhausted);
  EXPECT_THAT(Message(refused), HasSubstr("the tenant lab has 2 open sessions"));
  EXPECT_OK(office->CreateSession({.name = "", .camera = SmallCamera()}).status());
  EXPECT_OK(lab->FinishSession(first).status());
  EXPECT_OK(lab->CreateSession({.name = "", .camera = SmallCamera()}).status());
}

}  // namespace romap::access::authenticator_test
