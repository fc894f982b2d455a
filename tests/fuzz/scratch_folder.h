#pragma once

#include <string>
#include <string_view>

namespace romap::fuzz {

// A folder in memory (/dev/shm, or the folder for temporary files where there is none) for one process. Empty at first;
// removed at the end.
class ScratchFolder {
 public:
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::string& path() const { return path_; }
  std::string Path(std::string_view name) const { return path_ + "/" + std::string(name); }
  // Makes the folders of the file. Returns its path.
  std::string Write(std::string_view name, std::string_view bytes) const;
  std::string Read(std::string_view name) const;
  // Removes what is in the folder.
  void Clear() const;

 private:
  std::string path_;
};

}  // namespace romap::fuzz
