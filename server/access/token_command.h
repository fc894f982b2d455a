#pragma once

#include <functional>
#include <string>

namespace CLI {
class App;
}

namespace romap::access {

// The commands `token create`, `token list` and `token revoke`, which change the file of tokens. The server notices
// changes at once.
class TokenCommand {
 public:
  // Adds the command to a program. `default_file`: the file that the server of a data folder uses; "" = of the default
  // folder.
  TokenCommand(CLI::App* app, std::function<std::string(const std::string& data_dir)> default_file);

  bool IsChosen() const { return chosen_ != Choice::kNone; }
  // The exit status.
  int Run() const;

 private:
  enum class Choice { kNone, kCreate, kList, kRevoke };

  const std::function<std::string(const std::string& data_dir)> default_file_;
  Choice chosen_ = Choice::kNone;
  std::string data_dir_, token_file_, tenant_, name_ = "default", role_ = "owner", id_;
};

}  // namespace romap::access
