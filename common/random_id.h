#pragma once

#include <string>

namespace romap {

// 128 bits from the random source of the operating system, as 32 hexadecimal digits: nobody can guess it, and no two
// are the same.
std::string RandomId();

}  // namespace romap
