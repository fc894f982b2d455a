// The file of the tokens, and tokens that callers send.

#include "common/status.h"
#include "server/access/token_store.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/scratch_folder.h"

std::vector<std::string> romap::fuzz::Seeds() {
  const ScratchFolder folder;
  access::TokenStore store(folder.Path("tokens.json"));
  const std::string token = store.Create("arm-1", "lab", access::Role::kOwner).value();
  Require(store.Create("page", "lab", access::Role::kViewer).ok() && store.Find(token).has_value(),
          "a new token is valid");
  return {folder.Read("tokens.json"), token, R"({"version":1,"key":"ab","tokens":[]})"};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  static const std::string good = fuzz::Seeds()[0];
  const std::string text = fuzz::TextOf(data, size);
  folder.Clear();
  folder.Write("good.json", good);
  fuzz::Require(!access::TokenStore(folder.Path("good.json")).Find(text).has_value(), "a foreign token is not valid");

  access::TokenStore store(folder.Write("tokens.json", text));
  const auto tokens = store.List();
  (void)store.Find("romap_00000000_00");
  (void)store.Find(text.substr(0, 80));
  if (tokens.ok() && !tokens->empty()) {
    fuzz::Require(store.Revoke(tokens->front().id).ok(), "a token that is listed can be revoked");
    fuzz::Require(store.List().ok(), "the file can still be read");
  }
  return 0;
}
