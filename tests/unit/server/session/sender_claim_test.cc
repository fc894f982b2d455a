#include "server/session/sender_claim.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

namespace romap::session::sender_claim_test {

TEST(SenderClaimTest, OnlyTheTokenReplacesAStream) {
  SenderClaim claim("token");
  int replaced = 0;
  const auto first = claim.Attach("", [&] { ++replaced; });
  ASSERT_NE(first, nullptr);
  EXPECT_TRUE(claim.IsHeld());
  EXPECT_EQ(claim.Attach("", [] {}), nullptr);
  EXPECT_EQ(claim.Attach("other", [] {}), nullptr);
  const auto second = claim.Attach("token", [] {});
  ASSERT_NE(second, nullptr);
  EXPECT_EQ(replaced, 1);
  bool sent = false;
  EXPECT_FALSE(first->Run([&] { sent = true; }));
  EXPECT_FALSE(sent);
  EXPECT_TRUE(second->Run([&] { sent = true; }));
  EXPECT_TRUE(sent);
  claim.Release(first);
  EXPECT_TRUE(claim.IsHeld()) << "the replaced stream must not release the claim of its successor";
  claim.Release(second);
  EXPECT_FALSE(claim.IsHeld());
  EXPECT_NE(claim.Attach("", [] {}), nullptr);
}

TEST(SenderClaimTest, TheNextStreamWaitsForTheInputInProgress) {
  SenderClaim claim("token");
  const auto first = claim.Attach("", [] {});
  std::atomic<bool> sending = false, release = false, done = false;
  std::thread sender([&] {
    first->Run([&] {
      sending = true;
      while (!release) std::this_thread::yield();
      done = true;
    });
  });
  while (!sending) std::this_thread::yield();
  claim.Release(first);  // does not wait
  std::thread releaser([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    release = true;
  });
  EXPECT_NE(claim.Attach("", [] {}), nullptr);
  EXPECT_TRUE(done);
  sender.join();
  releaser.join();
}

}  // namespace romap::session::sender_claim_test
