#include "tests/support/subprocess.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

namespace romap::testing_support {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kPollPeriod{10};
constexpr std::chrono::seconds kLineTimeout{kUnderSanitizer ? 120 : 30};

std::string ReadFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string TemporaryFile() {
  std::string path = (fs::temp_directory_path() / "romap_process_XXXXXX").string();
  close(mkstemp(path.data()));
  return path;
}

}  // namespace

BackgroundProcess::BackgroundProcess(const std::vector<std::string>& command)
    : out_path_(TemporaryFile()), err_path_(TemporaryFile()) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  pid_ = fork();
  if (pid_ == 0) {
    dup2(open(out_path_.c_str(), O_WRONLY), STDOUT_FILENO);
    dup2(open(err_path_.c_str(), O_WRONLY), STDERR_FILENO);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
}

BackgroundProcess::~BackgroundProcess() {
  if (pid_ > 0) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  fs::remove(out_path_);
  fs::remove(err_path_);
}

std::string BackgroundProcess::WaitForLine(const std::string& prefix) {
  const auto deadline = std::chrono::steady_clock::now() + kLineTimeout;
  while (std::chrono::steady_clock::now() < deadline) {
    std::istringstream lines(ReadFile(out_path_));
    for (std::string line; std::getline(lines, line) && !lines.eof();) {
      if (line.starts_with(prefix)) return line.substr(prefix.size());
    }
    if (HasEnded()) {
      ADD_FAILURE() << "the program ended without a line that begins with '" << prefix
                    << "'; stderr: " << ReadFile(err_path_);
      return "";
    }
    std::this_thread::sleep_for(kPollPeriod);
  }
  ADD_FAILURE() << "no line that begins with '" << prefix << "' within " << kLineTimeout.count()
                << " s; stderr: " << ReadFile(err_path_);
  return "";
}

bool BackgroundProcess::HasEnded() const {
  siginfo_t info{};
  return waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid == pid_;
}

void BackgroundProcess::Signal(int signal) const { kill(pid_, signal); }

ProcessResult BackgroundProcess::Wait() {
  const auto deadline = std::chrono::steady_clock::now() + kProcessTimeout;
  while (!HasEnded()) {
    if (std::chrono::steady_clock::now() > deadline) {
      ADD_FAILURE() << "the program did not end within " << kProcessTimeout.count() << " s";
      Signal(SIGKILL);
      break;
    }
    std::this_thread::sleep_for(kPollPeriod);
  }
  ProcessResult result;
  int status = 0;
  waitpid(pid_, &status, 0);
  pid_ = -1;
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.out = ReadFile(out_path_);
  result.err = ReadFile(err_path_);
  return result;
}

ProcessResult RunProcess(const std::vector<std::string>& command) { return BackgroundProcess(command).Wait(); }

TemporaryFolder::TemporaryFolder() {
  path_ = (fs::temp_directory_path() / "romap_test_XXXXXX").string();
  if (mkdtemp(path_.data()) == nullptr) std::abort();
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code error;
  fs::remove_all(path_, error);
}

}  // namespace romap::testing_support
