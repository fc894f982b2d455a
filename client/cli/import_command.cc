#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "client/cli/command.h"
#include "client/cli/format_diagnostic.h"
#include "client/cli/interrupt.h"
#include "client/cli/progress.h"
#include "client/cli/sequence_arguments.h"
#include "client/importers/import_sequence.h"
#include "common/status.h"

namespace romap::cli {
namespace {

struct ImportOptions {
  SequenceArguments source;
  std::string out;
};

absl::Status Import(ImportOptions options) {
  // A sequence folder without depth images would be refused if it were asked for them.
  const std::filesystem::path source = options.source.dir;
  std::error_code error;
  const bool is_sequence =
      std::filesystem::exists(source / "rgb.txt", error) && std::filesystem::exists(source / "camera.yaml", error);
  options.source.read.files.use_depth = !is_sequence || std::filesystem::exists(source / "depth.txt", error);
  ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence, options.source.Open());
  Progress progress("importing");
  for (const Diagnostic& diagnostic : sequence.diagnostics()) progress.Say(FormatDiagnostic(diagnostic));
  absl::StatusOr<importers::ImportCounts> counts =
      importers::WriteNativeSequence(sequence, options.out, [&](size_t frame) {
        progress.Show(static_cast<double>(frame) / static_cast<double>(sequence.size()),
                      fmt::format("frame {}/{}", frame, sequence.size()));
        return !Interrupted();
      });
  progress.Done();
  ROMAP_RETURN_IF_ERROR(counts.status());
  fmt::print("{}: {} frames, {} with masks, {} with depth, {} with a pose\n", options.out, counts->frames,
             counts->masks, counts->depth_images, counts->poses);
  return absl::OkStatus();
}

}  // namespace

void AddImportCommand(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<ImportOptions>();
  CLI::App* command = app.add_subcommand(
      "import", "Convert a recording of any known layout to a sequence folder, with its depth images");
  options->source.AddSourceTo(*command);
  command->add_option("out", options->out, "New folder for the sequence")->required();
  command->callback([options, chosen] { *chosen = [options] { return Import(*options); }; });
}

}  // namespace romap::cli
