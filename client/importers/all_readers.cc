#include "client/importers/readers.h"

namespace romap::importers {

const std::vector<std::unique_ptr<SequenceReader>>& AllReaders() {
  static const std::vector<std::unique_ptr<SequenceReader>> kReaders = [] {
    std::vector<std::unique_ptr<SequenceReader>> readers;
    readers.push_back(MakeNativeReader());
    readers.push_back(MakeTransformsReader());
    readers.push_back(MakeColmapReader());
    readers.push_back(MakeVideoReader());
    readers.push_back(MakeImageFolderReader());
    return readers;
  }();
  return kReaders;
}

}  // namespace romap::importers
