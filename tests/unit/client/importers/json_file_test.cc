#include "client/importers/json_file.h"

#include <gmock/gmock.h>

#include "client/files/text_file.h"
#include "tests/support/subprocess.h"

namespace romap::importers::json_file_test {

using ::testing::HasSubstr;

class JsonFileTest : public ::testing::Test {
 protected:
  absl::StatusOr<nlohmann::json> Load(const std::string& text) const {
    EXPECT_TRUE(files::WriteFile(folder_ / "a.json", text).ok());
    return LoadJson(folder_ / "a.json");
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(JsonFileTest, RefusesMoreLevelsThanTheStackTakes) {
  EXPECT_TRUE(Load(R"({"a": [[[1, 2], [3]], {"b": [4]}]})").ok());
  for (const size_t levels : {size_t{100}, size_t{1'000'000}}) {
    const auto json = Load("{\"a\": " + std::string(levels, '[') + "1" + std::string(levels, ']') + "}");
    EXPECT_THAT(Message(json.status()), HasSubstr("more than 64 levels"));
  }
}

TEST_F(JsonFileTest, WholeNumbersAreInTheRangeOfTheirType) {
  const nlohmann::json json = {{"id", 7}, {"side", 1080.0}, {"half", 0.5}, {"huge", 1e300}};
  EXPECT_EQ(JsonWhole(json, "id", "a.json").value(), 7);
  EXPECT_EQ(JsonWhole(json, "side", "a.json").value(), 1080);
  EXPECT_THAT(Message(JsonWhole(json, "half", "a.json").status()), HasSubstr("'half' is 0.5; expected a whole number"));
  EXPECT_THAT(Message(JsonWhole(json, "huge", "a.json").status()), HasSubstr("expected a whole number"));
  EXPECT_FALSE(JsonWhole(json, "absent", "a.json").ok());
}

}  // namespace romap::importers::json_file_test
