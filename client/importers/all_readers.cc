#include "client/importers/readers.h"

namespace romap::importers {

const std::vector<std::unique_ptr<SequenceReader>>& AllReaders() {
  static const std::vector<std::unique_ptr<SequenceReader>> kReaders = [] {
    std::vector<std::unique_ptr<SequenceReader>> readers;
    readers.push_back(MakeNativeReader());
    readers.push_back(MakeEurocReader());
    readers.push_back(MakeScanNetReader());
    readers.push_back(MakeSevenScenesReader());
    readers.push_back(MakeReplicaReader());
    readers.push_back(MakeVmapReader());
    readers.push_back(MakeBopReader());
    readers.push_back(MakeArkitScenesReader());
    readers.push_back(MakePolycamReader());
    readers.push_back(MakeTransformsReader());
    readers.push_back(MakeColmapReader());
    readers.push_back(MakeTumReader());
    readers.push_back(MakeVideoReader());
    readers.push_back(MakeImageFolderReader());
    return readers;
  }();
  return kReaders;
}

}  // namespace romap::importers
