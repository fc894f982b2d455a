// Short texts from outside: numbers, times, addresses, names, and what goes to the log.

#include <cmath>

#include "client/files/text_file.h"
#include "client/files/time_unit.h"
#include "client/importers/folder.h"
#include "client/importers/matrix_pose.h"
#include "common/host_port.h"
#include "common/printable.h"
#include "common/utf8.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/scratch_folder.h"

std::vector<std::string> romap::fuzz::Seeds() {
  return {"127.0.0.1:50051",
          "[::1]:80",
          "localhost:0",
          "1305031102.175811023",
          "-1.5e-7",
          "rgb_0012.png",
          "a\x1b[31m\nb",
          "gr\xc3\xbc\xc3\x9f",
          "1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1\n",
          "1 0 0 nan\n0 1 0 inf\n0 0 1 0\n"};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  const std::string text = fuzz::TextOf(data, size);
  if (const auto address = ParseHostPort(text)) {
    fuzz::Require(address->port >= 0 && address->port <= 65535, "a port has 16 bits");
    (void)IsLoopback(*address);
  }
  for (const char c : Printable(text)) fuzz::Require(static_cast<unsigned char>(c) >= ' ', "no control characters");
  (void)PrintableLines(text);
  (void)IsUtf8(text);
  if (const auto number = files::ParseNumber(text)) fuzz::Require(std::isfinite(*number), "numbers are finite");
  if (const auto time_ns = files::ParseSeconds(text)) {
    fuzz::Require(files::ParseSeconds(files::FormatSeconds(*time_ns)) == time_ns, "a time can be written and read");
  }
  for (const int power : {-9, 0, 3, 18}) (void)files::ParseScaled(text, power);
  const std::vector<std::string> stamps = {text, "1", text.substr(0, text.size() / 2)};
  (void)files::DetectTimeUnit(stamps);
  (void)importers::NaturalLess(text, "rgb_10.png");
  fuzz::Require(!importers::NaturalLess(text, text), "the order of names is strict");
  (void)importers::LastNumber(text);
  const std::string path = folder.Write("pose.txt", text);
  (void)importers::ReadMatrixPose(path);
  (void)importers::ReadNumberLines(path);
  (void)files::ReadTable(path);
  (void)files::ReadLines(path);
  return 0;
}
