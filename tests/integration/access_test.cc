// Tokens, TLS and exposure, with the real programs.

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "client/synth/synth.h"
#include "tests/integration/quick_run.h"
#include "tests/support/subprocess.h"
#include "tests/support/test_certificates.h"

namespace romap::access_test {

using ::testing::HasSubstr;
using ::testing::Not;
using testing_support::BackgroundProcess;
using testing_support::ProcessResult;
using testing_support::RunProcess;

class AccessTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  ProcessResult Token(std::vector<std::string> arguments) {
    std::vector<std::string> command{ROMAP_SERVER, "token"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    command.insert(command.end(), {"--data-dir", folder_ / "data"});
    return RunProcess(command);
  }
  std::string NewTokenFile(const std::string& tenant, const std::string& role) {
    const ProcessResult created = Token({"create", "--tenant", tenant, "--role", role});
    EXPECT_EQ(created.exit_code, 0) << created.err;
    return Write(tenant + "_" + role + ".token", created.out);
  }
  std::vector<std::string> ServerCommand(const std::string& address, std::vector<std::string> arguments = {}) {
    std::vector<std::string> command{ROMAP_SERVER, "--listen", address, "--http", "", "--data-dir", folder_ / "data"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return integration::WithLittleTraining(command);
  }
  ProcessResult Client(const std::string& command, std::vector<std::string> arguments) {
    std::vector<std::string> whole{ROMAP_CLIENT, command};
    whole.insert(whole.end(), arguments.begin(), arguments.end());
    whole.insert(whole.end(), {"--server", address_, "--tls-ca", folder_ / "ca.pem"});
    return RunProcess(whole);
  }

  testing_support::TemporaryFolder folder_;
  std::unique_ptr<BackgroundProcess> server_;
  std::string address_;
};

TEST_F(AccessTest, ANetworkIsServedOnlyWithTlsAndTokens) {
  const ProcessResult open = RunProcess(ServerCommand("0.0.0.0:0"));
  EXPECT_EQ(open.exit_code, 2);
  EXPECT_THAT(open.err, HasSubstr("the server has no tokens"));
  NewTokenFile("lab", "owner");
  const ProcessResult clear = RunProcess(ServerCommand("0.0.0.0:0"));
  EXPECT_EQ(clear.exit_code, 2);
  EXPECT_THAT(clear.err, HasSubstr("the server has no TLS"));
  EXPECT_EQ(RunProcess(ServerCommand("0.0.0.0:0", {"--insecure-network", "--check-config"})).exit_code, 0);
}

TEST_F(AccessTest, AMapIsMadeAndReadWithTokensOverTls) {
  const testing_support::TestAuthority authority;
  const testing_support::CertificatePair pair = authority.Issue();
  Write("ca.pem", authority.certificate());
  const std::string owner = NewTokenFile("lab", "owner"), viewer = NewTokenFile("lab", "viewer");
  const std::string stranger = NewTokenFile("office", "owner");
  server_ = std::make_unique<BackgroundProcess>(ServerCommand(
      "127.0.0.1:0",
      {"--tls-cert", Write("certificate.pem", pair.certificate), "--tls-key", Write("key.pem", pair.key)}));
  address_ = server_->WaitForLine("romap-server listening on ");
  const synth::SynthOptions options{.seed = 3, .objects = 2, .frames = 20, .width_px = 320, .height_px = 240};
  ASSERT_TRUE(synth::MakeSequence(options, folder_ / "sequence").ok());

  const ProcessResult run = Client("run", {folder_ / "sequence", "--out", folder_ / "map", "--no-pictures",
                                           "--keep-session", "--token-file", owner});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string listed = Client("sessions", {"--token-file", viewer}).out;
  EXPECT_THAT(listed, HasSubstr("finished"));
  const std::string id = listed.substr(listed.find('\n') + 1, 32);
  EXPECT_EQ(Client("export", {id, "--out", folder_ / "copy", "--token-file", viewer}).exit_code, 0);

  EXPECT_THAT(Client("sessions", {}).err, HasSubstr("this server needs a token"));
  EXPECT_THAT(Client("sessions", {"--token-file", stranger}).out, HasSubstr("(no sessions)"));
  EXPECT_THAT(Client("sessions", {"--delete", id, "--token-file", stranger}).err, HasSubstr("does not exist"));
  EXPECT_THAT(Client("sessions", {"--delete", id, "--token-file", viewer}).err, HasSubstr("the role owner"));
  EXPECT_THAT(Client("sessions", {"--delete", id, "--token-file", owner}).out, HasSubstr("(no sessions)"));

  server_->Signal(SIGTERM);
  const ProcessResult log = server_->Wait();
  for (const std::string& file : {owner, viewer, stranger}) {
    std::string token;
    std::getline(std::ifstream(file), token);
    EXPECT_THAT(log.err, Not(HasSubstr(token.substr(token.rfind('_') + 1))));
  }
}

}  // namespace romap::access_test
