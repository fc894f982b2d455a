#pragma once

#include <string>

namespace romap::fuzz {

// Replaces the checksums of the chunks of a PNG file by the right ones, because a mutation that only makes a checksum
// wrong tests nothing else. Changes nothing in other files.
void RepairPng(std::string* bytes);

}  // namespace romap::fuzz
