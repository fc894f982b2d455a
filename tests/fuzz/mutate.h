#pragma once

#include <cstdint>
#include <random>
#include <string>

namespace romap::fuzz {

// Changes an input in a few random places: flips bits, cuts, repeats, inserts and overwrites parts, also with numbers
// at the limits of their types. The result has at most `max_bytes`.
void Mutate(std::string* input, size_t max_bytes, std::mt19937_64& random);

}  // namespace romap::fuzz
