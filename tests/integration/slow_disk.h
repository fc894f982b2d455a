#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace romap::integration {

// The disk of a server that is started with environment(): slow, hanging or failing by command; see
// tests/support/slow_disk.c.
class SlowDisk {
 public:
  // `control`: path of the file with the rule.
  explicit SlowDisk(std::string control) : control_(std::move(control)) {}

  std::vector<std::string> environment() const {
    // The runtime of AddressSanitizer demands to be loaded first.
    return {"LD_PRELOAD=" ROMAP_SLOW_DISK, "ASAN_OPTIONS=verify_asan_link_order=0", "ROMAP_TEST_DISK=" + control_};
  }
  // Empty: it works.
  void SetRule(const std::string& rule) {
    std::ofstream(control_ + ".new") << rule;
    std::filesystem::rename(control_ + ".new", control_);
  }

 private:
  const std::string control_;
};

}  // namespace romap::integration
