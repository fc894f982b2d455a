#pragma once

#include <string>
#include <string_view>

namespace romap {

// Text from outside for a terminal or a log: control characters (also those that change the direction of text or end a
// line) and bytes that are not UTF-8 become visible as \n, \t, \x1b or \u202e. A backslash stays as it is.
std::string Printable(std::string_view text);
// The same for a text of several lines: \n stays as it is.
std::string PrintableLines(std::string_view text);

}  // namespace romap
