#pragma once

#include <string>
#include <string_view>

#include "tests/fuzz/scratch_folder.h"

namespace romap::fuzz {

// A folder as one input: before each file a line `=== NAME`, e.g. "=== images/1.png\n".

// The files of a folder and its subfolders in the order of their names, without those that are larger than
// `max_file_bytes`.
std::string FolderAsText(const std::string& path, size_t max_file_bytes = 4096);

// Replaces the content of the folder. Of a name that is not relative or would leave the folder, and of the files after
// the 64th, nothing is written. With `repair_png`, files that begin like a PNG file get valid checksums.
void WriteFolder(std::string_view text, const ScratchFolder& folder, bool repair_png = true);

}  // namespace romap::fuzz
