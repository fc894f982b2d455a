// Configuration files and --set.

#include "common/config.h"
#include "tests/fuzz/fuzz_target.h"

namespace romap::fuzz::config_fuzz {
namespace {

struct Settings {
  int rays = 1024;
  int width = 32;
  double rate = 0.02;
  double final_rate = 0.002;
  bool enabled = true;
  std::string kind = "density";
  std::string folder;
  std::string preset = "usual";

  ConfigFields Fields() {
    ConfigFields fields;
    fields.Section("nerf");
    fields.Add("preset", &preset,
               {.choices = {"usual", "fast"}, .help = "Sets others", .on_set = [this](const std::string& value) {
                  if (value == "fast") rays = 512;
                }});
    fields.Add("rays", &rays,
               {.unit = "rays", .min = 1, .max = 65536, .audience = Audience::kOperator, .help = "Rays"});
    fields.Add("width", &width, {.min = 16, .max = 256, .multiple_of = 16, .help = "Width of the layer"});
    fields.Add("rate", &rate, {.min = 0, .max = 1, .help = "Learning rate"});
    fields.Add("final_rate", &final_rate, {.min = 0, .max = 1, .help = "Learning rate at the end"});
    fields.Section("mesh");
    fields.Add("enabled", &enabled, {.help = "Make meshes"});
    fields.Add("kind", &kind, {.choices = {"density", "sdf"}, .help = "Field kind"});
    fields.Add("folder", &folder, {.help = "Where they go"});
    fields.IgnoreSection("client");
    fields.AddRules([this](ConfigRules& rules) {
      rules.RequireAtMost(&final_rate, &rate);
      rules.Forbid(kind == "sdf" && !enabled, &kind, "needs", &enabled, "set it to true");
    });
    return fields;
  }
};

}  // namespace
}  // namespace romap::fuzz::config_fuzz

std::vector<std::string> romap::fuzz::Seeds() {
  config_fuzz::Settings settings;
  return {settings.Fields().DumpYaml(),
          "nerf: {rays: 2048, rate: 1e-3}\nmesh:\n  kind: sdf\n  folder: \"a b\"\n",
          "client: [1, 2]\nnerf:\n  preset: fast\n  rayz: 3\n",
          "nerf.rays=96",
          "mesh.folder=a=b",
          "a: &x [1]\nb: *x\nnerf: {? rays : 7}\n"};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  const std::string text = fuzz::TextOf(data, size);
  fuzz::config_fuzz::Settings assigned;
  const std::vector<std::string> assignments = {text};
  (void)assigned.Fields().Set(assignments);

  fuzz::config_fuzz::Settings settings;
  ConfigFields fields = settings.Fields();
  if (!fields.LoadYaml(text, "server.yaml").ok() || !fields.Validate().ok()) return 0;
  fuzz::config_fuzz::Settings copy;
  ConfigFields copied = copy.Fields();
  const absl::Status read = copied.LoadYaml(fields.DumpYaml(), "dump.yaml");
  fuzz::Require(read.ok(), "the dump can be read");
  fuzz::Require(copy.rays == settings.rays && copy.folder == settings.folder && copy.kind == settings.kind &&
                    copy.rate == settings.rate,
                "the dump has the values");
  return 0;
}
