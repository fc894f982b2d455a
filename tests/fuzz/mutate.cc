#include "tests/fuzz/mutate.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace romap::fuzz {
namespace {

// Not std::uniform_int_distribution, whose results depend on the library.
size_t Below(size_t limit, std::mt19937_64& random) { return limit == 0 ? 0 : random() % limit; }

constexpr std::array<uint64_t, 14> kNumbers{
    0, 1, 127, 128, 255, 256, 32767, 65535, 65536, 0x7fffffff, 0x80000000, 0xffffffff, ~uint64_t{0}, uint64_t{1} << 63};
constexpr std::array<std::string_view, 12> kTexts{
    "-1", "0", "1e999", "nan", "inf", "99999999999999999999", "2147483648", "\"", "\n", "-0.0000001", "{", "]"};

std::string Interesting(std::mt19937_64& random) {
  if (Below(3, random) == 0) return std::string(kTexts[Below(kTexts.size(), random)]);
  const uint64_t number = kNumbers[Below(kNumbers.size(), random)];
  const size_t bytes = size_t{1} << Below(4, random);
  std::string text;
  for (size_t i = 0; i < bytes; ++i) text += static_cast<char>(number >> (8 * i));
  if (Below(2, random) == 0) std::ranges::reverse(text);
  return text;
}

void MutateOnce(std::string* input, std::mt19937_64& random) {
  const size_t at = Below(input->size() + 1, random);
  const size_t length = std::min(input->size() - at, 1 + Below(16, random));
  switch (Below(7, random)) {
    case 0:
      if (at < input->size()) (*input)[at] = static_cast<char>((*input)[at] ^ (1 << Below(8, random)));
      break;
    case 1:
      input->erase(at, length);
      break;
    case 2:
      input->resize(at);
      break;
    case 3:  // repeat a part, perhaps many times
      input->insert(at, std::string(input->substr(at, length)));
      for (size_t times = Below(8, random) == 0 ? 200 : 0; times > 0; --times) {
        input->insert(at, std::string(input->substr(at, length)));
      }
      break;
    case 4:
      input->insert(at, Interesting(random));
      break;
    case 5: {
      const std::string number = Interesting(random);
      input->replace(at, std::min(number.size(), input->size() - at), number);
      break;
    }
    default:  // copy a part to another place
      input->insert(Below(input->size() + 1, random), std::string(input->substr(at, 4 * length)));
      break;
  }
}

}  // namespace

void Mutate(std::string* input, size_t max_bytes, std::mt19937_64& random) {
  for (size_t count = 1 + Below(4, random); count > 0; --count) MutateOnce(input, random);
  if (input->size() > max_bytes) input->resize(max_bytes);
}

}  // namespace romap::fuzz
