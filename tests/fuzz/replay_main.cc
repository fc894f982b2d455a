// Runs a target without libFuzzer: its seeds, the inputs in the folder of the first argument (if it exists) and
// deterministic mutations of both. An input that ends the process or takes too long is written to the folder of the
// second argument.

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/mutate.h"
#include "tests/support/sanitizer.h"

// Only with AddressSanitizer or another one.
extern "C" __attribute__((weak)) void __sanitizer_set_death_callback(void (*callback)());

namespace romap::fuzz::replay_main {
namespace {

namespace fs = std::filesystem;

constexpr int kMutations = 4000;
constexpr std::chrono::seconds kTimeForMutations{testing_support::kUnderSanitizer ? 3 : 1};
constexpr size_t kMaxBytes = 65536;
// A finding. Far above the second that a small input may take, because the machine may be busy.
constexpr unsigned kMaxSeconds = testing_support::kUnderSanitizer ? 120 : 30;
constexpr long kMaxMemory_kib = (testing_support::kUnderSanitizer ? 3L : 1L) << 20;

std::string input;      // in use
std::string kept_path;  // for the input that ends the process

// Called in a signal handler, so it may only call the system.
void KeepInput() {
  const int file = open(kept_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  if (file < 0) return;
  (void)!write(file, input.data(), input.size());
  close(file);
  constexpr char kText[] = "fuzz: the input is in ";
  (void)!write(STDERR_FILENO, kText, sizeof(kText) - 1);
  (void)!write(STDERR_FILENO, kept_path.data(), kept_path.size());
  (void)!write(STDERR_FILENO, "\n", 1);
}

void OnSignal(int signal) {
  if (signal == SIGALRM) {
    constexpr char kText[] = "fuzz: one input takes too long\n";
    (void)!write(STDERR_FILENO, kText, sizeof(kText) - 1);
  }
  KeepInput();
  std::signal(signal, SIG_DFL);
  raise(signal);
}

void Watch() {
  for (const int signal : {SIGABRT, SIGALRM, SIGFPE}) std::signal(signal, OnSignal);
  if (__sanitizer_set_death_callback != nullptr) {
    __sanitizer_set_death_callback(KeepInput);  // it handles the others itself
  } else {
    for (const int signal : {SIGSEGV, SIGBUS, SIGILL}) std::signal(signal, OnSignal);
  }
}

void Run() {
  alarm(kMaxSeconds);
  LLVMFuzzerTestOneInput(reinterpret_cast<const uint8_t*>(input.data()), input.size());
  alarm(0);
}

std::vector<std::string> ReadFolder(const std::string& folder) {
  std::vector<fs::path> paths;
  if (fs::is_directory(folder)) {
    for (const auto& entry : fs::directory_iterator(folder)) paths.push_back(entry.path());
  }
  std::ranges::sort(paths);
  std::vector<std::string> contents;
  for (const fs::path& path : paths) {
    std::ifstream file(path, std::ios::binary);
    contents.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  return contents;
}

int Main(const std::string& corpus_folder, const std::string& kept_folder, const std::string& name) {
  kept_path = kept_folder + "/finding_" + name;
  Watch();
  std::vector<std::string> corpus = Seeds();
  if (corpus.empty()) {
    std::fprintf(stderr, "fuzz: the target has no seeds\n");
    return 1;
  }
  std::ranges::copy(ReadFolder(corpus_folder), std::back_inserter(corpus));
  corpus.emplace_back();
  for (const std::string& known : corpus) {
    input = known;
    Run();
  }
  std::mt19937_64 random(1);
  const auto begin = std::chrono::steady_clock::now();
  int mutations = 0;
  while (mutations < kMutations && std::chrono::steady_clock::now() - begin < kTimeForMutations) {
    input = corpus[random() % corpus.size()];
    Mutate(&input, kMaxBytes, random);
    Run();
    ++mutations;
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("%zu inputs and %d mutations of them, %ld MiB of memory\n", corpus.size(), mutations,
              usage.ru_maxrss >> 10);
  if (usage.ru_maxrss <= kMaxMemory_kib) return 0;
  std::fprintf(stderr, "fuzz: an input needs too much memory\n");
  return 1;
}

}  // namespace
}  // namespace romap::fuzz::replay_main

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: %s CORPUS_FOLDER FOLDER_FOR_FINDINGS\n", argv[0]);
    return 2;
  }
  const char* slash = std::strrchr(argv[0], '/');
  return romap::fuzz::replay_main::Main(argv[1], argv[2], slash == nullptr ? argv[0] : slash + 1);
}
