#include "tests/support/test_jpeg.h"

namespace romap::testing_support {

std::string WithScans(const std::string& bytes, int more) {
  const size_t end = bytes.rfind("\xff\xd9");
  const size_t scan = bytes.rfind("\xff\xda");
  const size_t tables = bytes.rfind("\xff\xc4", scan);
  const std::string last = bytes.substr(tables, end - tables);
  std::string result = bytes.substr(0, end);
  for (int i = 0; i < more; ++i) result += last;
  return result + bytes.substr(end);
}

}  // namespace romap::testing_support
