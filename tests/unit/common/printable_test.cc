#include "common/printable.h"

#include <gtest/gtest.h>

#include "common/utf8.h"

namespace romap::printable_test {

TEST(PrintableTest, EscapesWhatATerminalWouldExecute) {
  EXPECT_EQ(Printable("K\xc3\xbc"
                      "che \xe5\x8f\xb0 \\ 1"),
            "K\xc3\xbc"
            "che \xe5\x8f\xb0 \\ 1");
  EXPECT_EQ(Printable("a\nb\tc\r"), "a\\nb\\tc\\r");
  EXPECT_EQ(Printable("\x1b]0;title\x07\x1b[2J"), "\\x1b]0;title\\x07\\x1b[2J");
  EXPECT_EQ(Printable(std::string_view("a\0b\x7f", 4)), "a\\x00b\\x7f");
  EXPECT_EQ(Printable("\xc2\x9b"
                      "31m"),
            "\\x9b31m")
      << "a control sequence introducer of one character";
  EXPECT_EQ(Printable("\xe2\x80\xae"
                      "gpj.exe"),
            "\\u202egpj.exe")
      << "right to left";
  EXPECT_EQ(PrintableLines("a\nb\x1b"), "a\nb\\x1b");
}

TEST(PrintableTest, EscapesBytesThatAreNotUtf8) {
  EXPECT_EQ(Printable("\xff"
                      "a\xc3"),
            "\\xffa\\xc3");
  for (int a = 0; a < 256; ++a) {
    for (int b = 0; b < 256; ++b) {
      const std::string text{static_cast<char>(a), static_cast<char>(b), 'x'};
      EXPECT_TRUE(IsUtf8(Printable(text))) << a << " " << b;
    }
  }
}

}  // namespace romap::printable_test
