#include "common/utf8.h"

#include <gtest/gtest.h>

namespace romap::utf8_test {

TEST(Utf8Test, AcceptsWellFormedText) {
  for (const char* text : {"", "cup", "caf\xC3\xA9", "\xE6\x9D\xAF", "\xF0\x9F\xA5\xA4", "\xF4\x8F\xBF\xBF"}) {
    EXPECT_TRUE(IsUtf8(text)) << text;
  }
}

TEST(Utf8Test, RejectsMalformedText) {
  for (const char* text : {"caf\xE9", "\x80", "\xC3", "\xC0\xAF", "\xE0\x80\x80", "\xED\xA0\x80", "\xF4\x90\x80\x80",
                           "\xF0\x9F\xA5", "\xFF"}) {
    EXPECT_FALSE(IsUtf8(text)) << text;
  }
}

}  // namespace romap::utf8_test
