#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace romap::importers {

bool IsFile(const std::string& path);
bool IsFolder(const std::string& path);

// Compares names with their numbers as numbers: "rgb_2.png" before "rgb_10.png".
bool NaturalLess(std::string_view a, std::string_view b);

// The names of the files in a folder (of the folders), in natural order; empty if it cannot be read. Hidden ones are
// omitted. `extension`: without it all files; with upper or lower case letters.
std::vector<std::string> FileNames(const std::string& folder, std::string_view extension = "");
std::vector<std::string> FolderNames(const std::string& folder);

// The first of these paths in `folder` that exists.
std::optional<std::string> FirstExisting(const std::string& folder, std::initializer_list<const char*> names);

// Of the last component of a path, without the part behind its last dot.
std::string StemOf(const std::string& path);
// The last component of a path.
std::string NameOf(const std::string& path);

// The last number in a stem: 12 of "rgb_0012". nullopt: it has none, or it is too large.
std::optional<int64_t> LastNumber(std::string_view stem);

// The content of a folder in a few words, or what kind of file it is, for messages.
std::string DescribeSource(const std::string& source);

}  // namespace romap::importers
