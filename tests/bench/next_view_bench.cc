// Measures whether the view that a mesh asks for (MeshUpdate.next_view) improves the mesh more than other views.
//
//   next_view_bench ROMAP OUT_DIR SEED...
//
// ROMAP is the program romap. For each seed, renders an orbit of 150 frames around five objects and maps its first 50
// frames, that is, one third of the circle. Then, for each object, maps these frames with 8 more: those nearest to the
// direction that the object's mesh asks for, and those around frames of the rest of the orbit that are chosen at
// random. Prints the error against the whole true surface and the completion of each object before and after.

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "client/files/text_file.h"
#include "client/files/tum.h"
#include "tests/support/recording.h"

namespace romap::measure {
namespace {

constexpr int kOrbitFrames = 150;
constexpr int kFirstFrames = 50;
constexpr int kAddedFrames = 8;
constexpr int kRandomChoices = 3;

struct Errors {
  double closed_cm = 0;
  double completion_cm = 0;
};

struct MappedObject {
  std::string name;  // of the ground truth
  Eigen::Vector3d center_world = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> next_view_world = {};
  Errors errors;
};

void RunOrExit(const std::string& command) {
  if (std::system((command + " >/dev/null").c_str()) == 0) return;
  fmt::print(stderr, "next_view_bench: failed: {}\n", command);
  std::exit(1);
}

Eigen::Vector3d ToVector(const nlohmann::json& values) {
  return {values[0].get<double>(), values[1].get<double>(), values[2].get<double>()};
}

class Orbit {
 public:
  Orbit(std::string romap, std::string dir, int seed) : romap_(std::move(romap)), dir_(std::move(dir)) {
    if (!std::filesystem::exists(dir_ + "/objects.yaml")) {
      RunOrExit(fmt::format("{} synth --out {} --frames {} --objects 5 --seed {}", romap_, dir_, kOrbitFrames, seed));
    }
    poses_ = files::ReadTum(dir_ + "/groundtruth.txt").value();
    const std::vector<files::TextLine> lines = files::ReadLines(dir_ + "/rgb.txt").value();
    for (const files::TextLine& line : lines) lines_.push_back(line.text);
  }

  // Maps some frames of the orbit. By the name of the true object.
  std::map<std::string, MappedObject> Map(const std::set<int>& frames) const {
    const std::string part = dir_ + ".part", out = dir_ + ".map";
    std::filesystem::remove_all(part);
    const testing_support::Recording recording(dir_, part);
    std::string list;
    for (const int frame : frames) list += lines_.at(frame) + "\n";
    recording.Write("rgb.txt", list);
    RunOrExit(
        fmt::format("{} run {} --out {} --local --set session.single_thread=true --no-pictures", romap_, part, out));
    std::ifstream in(out + "/summary.json");
    const nlohmann::json summary = nlohmann::json::parse(in);
    std::map<std::string, MappedObject> objects;
    for (const nlohmann::json& row : summary["evaluation"]["objects"]["objects"]) {
      if (row["predicted"].is_null() || row["acc_closed_cm"].is_null()) continue;
      MappedObject object{.name = row["object"].get<std::string>(),
                          .errors = {row["acc_closed_cm"].get<double>(), row["comp_cm"].get<double>()}};
      for (const nlohmann::json& mapped : summary["objects"]) {
        if (mapped["name"] != row["predicted"]) continue;
        object.center_world = ToVector(mapped["center_world_mu"]);
        if (!mapped["next_view_world"].is_null()) object.next_view_world = ToVector(mapped["next_view_world"]);
      }
      objects[object.name] = object;
    }
    return objects;
  }

  // The frame of the rest of the orbit whose camera is nearest to a direction from an object.
  int NearestFrame(const MappedObject& object) const {
    const auto cosine = [&](int frame) {
      return (poses_.at(frame).T_world_camera.translation() - object.center_world)
          .normalized()
          .dot(*object.next_view_world);
    };
    int best = kFirstFrames;
    for (int frame = kFirstFrames; frame < kOrbitFrames; ++frame) {
      if (cosine(frame) > cosine(best)) best = frame;
    }
    return best;
  }

 private:
  std::string romap_, dir_;
  std::vector<files::StampedPose> poses_;
  std::vector<std::string> lines_;
};

std::set<int> FirstFrames() {
  std::set<int> frames;
  for (int frame = 0; frame < kFirstFrames; ++frame) frames.insert(frame);
  return frames;
}

// The first frames, and some around another one.
std::set<int> WithFramesAround(int center) {
  std::set<int> frames = FirstFrames();
  const int first = std::clamp(center - kAddedFrames / 2, kFirstFrames, kOrbitFrames - kAddedFrames);
  for (int k = 0; k < kAddedFrames; ++k) frames.insert(first + k);
  return frames;
}

void AddRow(const std::string& name, const Errors& before, const Errors& next, const Errors& random) {
  fmt::print("| {} | {:.3f} | {:.3f} | {:.3f} | {:.3f} | {:.3f} | {:.3f} |\n", name, before.closed_cm, next.closed_cm,
             random.closed_cm, before.completion_cm, next.completion_cm, random.completion_cm);
  std::fflush(stdout);
}

void Measure(const std::string& romap, const std::string& out, const std::vector<int>& seeds) {
  fmt::print(
      "| object | closed: first | with next view | with random view | comp: first | with next | with random |\n");
  fmt::print("| --- | --- | --- | --- | --- | --- | --- |\n");
  Errors before_sum, next_sum, random_sum;
  int rows = 0;
  for (const int seed : seeds) {
    const Orbit orbit(romap, fmt::format("{}/orbit_{}", out, seed), seed);
    std::mt19937 random(static_cast<unsigned>(seed));
    for (const auto& [name, object] : orbit.Map(FirstFrames())) {
      if (!object.next_view_world) continue;
      const auto errors_with = [&, &name = name, &object = object](int frame) {
        const auto objects = orbit.Map(WithFramesAround(frame));
        const auto found = objects.find(name);
        return found == objects.end() ? object.errors : found->second.errors;
      };
      const Errors next = errors_with(orbit.NearestFrame(object));
      Errors mean;
      for (int k = 0; k < kRandomChoices; ++k) {
        const int frame = std::uniform_int_distribution<int>(kFirstFrames, kOrbitFrames - 1)(random);
        const Errors one = errors_with(frame);
        mean.closed_cm += one.closed_cm / kRandomChoices;
        mean.completion_cm += one.completion_cm / kRandomChoices;
      }
      AddRow(fmt::format("seed {} {}", seed, name), object.errors, next, mean);
      const auto add = [](const Errors& errors, Errors* sum) {
        sum->closed_cm += errors.closed_cm;
        sum->completion_cm += errors.completion_cm;
      };
      add(object.errors, &before_sum);
      add(next, &next_sum);
      add(mean, &random_sum);
      ++rows;
    }
  }
  if (rows == 0) return;
  const auto mean = [&](const Errors& sum) { return Errors{sum.closed_cm / rows, sum.completion_cm / rows}; };
  AddRow("mean", mean(before_sum), mean(next_sum), mean(random_sum));
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) {
  if (argc < 4) {
    fmt::print(stderr, "usage: {} ROMAP OUT_DIR SEED...\n", argv[0]);
    return 2;
  }
  std::vector<int> seeds;
  for (int i = 3; i < argc; ++i) seeds.push_back(std::atoi(argv[i]));
  std::filesystem::create_directories(argv[2]);
  romap::measure::Measure(argv[1], argv[2], seeds);
}
