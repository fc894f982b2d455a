#include "client/files/native_sequence.h"
#include "client/importers/folder.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

class NativeReader : public SequenceReader {
 public:
  std::string Name() const override { return "romap sequence"; }
  std::string Expected() const override { return "rgb.txt and camera.yaml"; }
  bool Fits(const std::string& source) const override {
    return IsFile(source + "/rgb.txt") && IsFile(source + "/camera.yaml");
  }
  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions& options) const override {
    ROMAP_ASSIGN_OR_RETURN(files::SequenceContents native, files::ReadNativeSequence(source, options.files));
    RecordingContents contents{.source = source,
                               .camera = native.camera,
                               .frames = {},
                               .objects = std::move(native.objects),
                               .diagnostics = std::move(native.diagnostics)};
    for (files::FrameRecord& frame : native.frames) {
      static_cast<files::FrameRecord&>(contents.frames.emplace_back()) = std::move(frame);
    }
    return contents;
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeNativeReader() { return std::make_unique<NativeReader>(); }

}  // namespace romap::importers
