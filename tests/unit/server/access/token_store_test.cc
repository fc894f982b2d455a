#include "server/access/token_store.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <fstream>
#include <iterator>
#include <thread>

#include "common/status.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::access::token_store_test {

using absl::StatusCode;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using testing_support::TemporaryFolder;

class TokenStoreTest : public ::testing::Test {
 protected:
  std::string Text() const {
    std::ifstream stream(path_);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  TemporaryFolder folder_;
  std::string path_ = folder_ / "tokens.json";
  TokenStore tokens_{path_};
};

TEST_F(TokenStoreTest, ACreatedTokenIdentifiesItsTenantAndRole) {
  EXPECT_FALSE(tokens_.Exists());
  const std::string token = tokens_.Create("arm-1", "lab", Role::kOwner).value();
  const std::string other = tokens_.Create("desk", "office", Role::kViewer).value();
  EXPECT_TRUE(tokens_.Exists());
  const auto identity = tokens_.Find(token);
  ASSERT_TRUE(identity);
  EXPECT_EQ(identity->tenant, "lab");
  EXPECT_EQ(identity->role, Role::kOwner);
  EXPECT_EQ(tokens_.Find(other)->tenant, "office");
  EXPECT_NE(token, other);
}

TEST_F(TokenStoreTest, NoOtherTextIsAToken) {
  const std::string token = tokens_.Create("a", "lab", Role::kAdmin).value();
  std::string changed = token;
  changed.back() = changed.back() == '0' ? '1' : '0';
  for (const std::string& text : {std::string(), std::string("romap_"), std::string("romap__"), token + "0", changed,
                                  token.substr(0, token.size() - 1), token.substr(1), token.substr(0, 15)}) {
    EXPECT_FALSE(tokens_.Find(text)) << text;
  }
}

TEST_F(TokenStoreTest, TheFileHasNoSecretAndOnlyItsUserReadsIt) {
  const std::string token = tokens_.Create("a", "lab", Role::kOwner).value();
  const std::string secret = token.substr(token.rfind('_') + 1);
  EXPECT_EQ(secret.size(), 64u);  // 256 bits
  EXPECT_THAT(Text(), Not(HasSubstr(secret)));
  struct stat status {};
  ASSERT_EQ(stat(path_.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
}

TEST_F(TokenStoreTest, ARevokedTokenIsInvalidAlsoForOtherReaders) {
  const std::string token = tokens_.Create("a", "lab", Role::kOwner).value();
  const TokenStore reader(path_);
  EXPECT_TRUE(reader.Find(token));
  EXPECT_OK(tokens_.Revoke(tokens_.List()->at(0).id));
  EXPECT_FALSE(reader.Find(token));
  EXPECT_TRUE(reader.Exists()) << "calls still need a token";
  EXPECT_CODE(tokens_.Revoke("0badc0de"), StatusCode::kNotFound);
}

TEST_F(TokenStoreTest, ADamagedFileMakesAllTokensInvalid) {
  const std::string token = tokens_.Create("a", "lab", Role::kOwner).value();
  for (const char* text : {"", "{", "[]", R"({"version": 1, "key": 3, "tokens": []})", R"({"version": 2})"}) {
    std::ofstream(path_) << text;
    EXPECT_FALSE(TokenStore(path_).Find(token));
    EXPECT_FALSE(TokenStore(path_).List().ok()) << text;
    EXPECT_FALSE(TokenStore(path_).Create("b", "lab", Role::kOwner).ok()) << "must not replace a damaged file";
  }
}

TEST_F(TokenStoreTest, NamesAreChecked) {
  for (const std::string& name : {std::string(), std::string("a b"), std::string("a\n"), std::string(65, 'x')}) {
    EXPECT_CODE(tokens_.Create(name, "lab", Role::kOwner).status(), StatusCode::kInvalidArgument);
    EXPECT_CODE(tokens_.Create("a", name, Role::kOwner).status(), StatusCode::kInvalidArgument);
  }
  EXPECT_CODE(ParseRole("root").status(), StatusCode::kInvalidArgument);
  EXPECT_EQ(ParseRole(ToString(Role::kAdmin)).value(), Role::kAdmin);
}

TEST_F(TokenStoreTest, ConcurrentChangesAreAllKept) {
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      for (int k = 0; k < 5; ++k) EXPECT_OK(TokenStore(path_).Create("a", "lab", Role::kOwner).status());
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_THAT(tokens_.List().value(), SizeIs(20));
}

}  // namespace romap::access::token_store_test
