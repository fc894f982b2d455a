#pragma once

#include <memory>
#include <vector>

#include "client/importers/sequence_reader.h"

namespace romap::importers {

std::unique_ptr<SequenceReader> MakeNativeReader();
std::unique_ptr<SequenceReader> MakeEurocReader();
std::unique_ptr<SequenceReader> MakeScanNetReader();
std::unique_ptr<SequenceReader> MakeSevenScenesReader();
std::unique_ptr<SequenceReader> MakeReplicaReader();
std::unique_ptr<SequenceReader> MakeVmapReader();
std::unique_ptr<SequenceReader> MakeBopReader();
std::unique_ptr<SequenceReader> MakeArkitScenesReader();
std::unique_ptr<SequenceReader> MakePolycamReader();
std::unique_ptr<SequenceReader> MakeTransformsReader();
std::unique_ptr<SequenceReader> MakeColmapReader();
std::unique_ptr<SequenceReader> MakeTumReader();
std::unique_ptr<SequenceReader> MakeVideoReader();
std::unique_ptr<SequenceReader> MakeImageFolderReader();

// All readers. The first that fits reads a recording, so layouts with few characteristic files come last.
const std::vector<std::unique_ptr<SequenceReader>>& AllReaders();

}  // namespace romap::importers
