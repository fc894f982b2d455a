#include "client/doctor/stamps_check.h"

#include <gmock/gmock.h>

namespace romap::doctor::stamps_check_test {

using ::testing::HasSubstr;

std::vector<int64_t> Stamps(int frames, double fps) {
  std::vector<int64_t> stamps_ns;
  for (int i = 0; i < frames; ++i) stamps_ns.push_back(static_cast<int64_t>(1e9 * i / fps));
  return stamps_ns;
}

TEST(StampsCheckTest, AcceptsTheNominalRate) { EXPECT_TRUE(CheckStamps(Stamps(100, 30), 30).empty()); }

TEST(StampsCheckTest, NamesAnotherRate) {
  const std::vector<Diagnostic> found = CheckStamps(Stamps(100, 10), 30);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].code, "frame_rate");
  EXPECT_THAT(found[0].text, HasSubstr("10.0 frames per second, camera.yaml says 30.0"));
}

TEST(StampsCheckTest, CountsGaps) {
  std::vector<int64_t> stamps_ns = Stamps(100, 30);
  stamps_ns.erase(stamps_ns.begin() + 40, stamps_ns.begin() + 50);
  const std::vector<Diagnostic> found = CheckStamps(stamps_ns, 30);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].code, "frames_missing");
  EXPECT_EQ(found[0].count, 1u);
  EXPECT_EQ(found[0].first_frame_id, 41u);
}

TEST(StampsCheckTest, AFewFramesAreNotJudged) { EXPECT_TRUE(CheckStamps(Stamps(3, 1), 30).empty()); }

}  // namespace romap::doctor::stamps_check_test
