#include "common/random_id.h"

#include <gtest/gtest.h>

#include <array>
#include <set>
#include <string>

namespace romap::random_id_test {

TEST(RandomIdTest, HasAllItsBits) {
  std::set<std::string> ids;
  std::array<std::set<char>, 32> digits;
  for (int i = 0; i < 500; ++i) {
    const std::string id = RandomId();
    ASSERT_EQ(id.size(), 32u);
    ids.insert(id);
    for (size_t k = 0; k < id.size(); ++k) digits[k].insert(id[k]);
  }
  EXPECT_EQ(ids.size(), 500u);
  // Each place takes all 16 values: one is missing with a probability of about 5e-12.
  for (const std::set<char>& values : digits) EXPECT_EQ(values.size(), 16u);
}

}  // namespace romap::random_id_test
