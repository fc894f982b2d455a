#include "server/access/token_command.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <utility>
#include <vector>

#include "common/exit_code.h"
#include "common/status.h"
#include "server/access/token_store.h"

namespace romap::access {
namespace {

absl::Status CreateToken(TokenStore& tokens, const std::string& name, const std::string& tenant,
                         const std::string& role_text) {
  ROMAP_ASSIGN_OR_RETURN(const Role role, ParseRole(role_text));
  const bool is_first = !tokens.Exists();
  ROMAP_ASSIGN_OR_RETURN(const std::string token, tokens.Create(name, tenant, role));
  // Only the token itself, so that scripts can store it.
  fmt::print("{}\n", token);
  if (is_first) fmt::print(stderr, "romap-server: from now on every call to this server needs a token\n");
  return absl::OkStatus();
}

absl::Status ListTokens(const TokenStore& tokens) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<TokenRecord> records, tokens.List());
  if (!tokens.Exists()) {
    fmt::print("(no tokens: every call is allowed)\n");
    return absl::OkStatus();
  }
  fmt::print("{:<8}  {:<20}  {:<20}  {:<6}  created (UTC)\n", "id", "tenant", "name", "role");
  for (const TokenRecord& token : records) {
    fmt::print("{:<8}  {:<20}  {:<20}  {:<6}  {:%Y-%m-%d %H:%M}\n", token.id, token.tenant, token.name,
               ToString(token.role), fmt::gmtime(static_cast<std::time_t>(token.created_unix_s)));
  }
  return absl::OkStatus();
}

}  // namespace

TokenCommand::TokenCommand(CLI::App* app, std::function<std::string(const std::string& data_dir)> default_file)
    : default_file_(std::move(default_file)) {
  CLI::App* token = app->add_subcommand("token", "Create, list and revoke the tokens that callers of the server need");
  token->require_subcommand(1);
  const auto add = [&](const char* name, const char* help, Choice choice) {
    CLI::App* command = token->add_subcommand(name, help);
    command->callback([this, choice] { chosen_ = choice; });
    command->add_option("--data-dir", data_dir_, "Data folder of the server; the tokens are in its tokens.json");
    command->add_option("--token-file", token_file_, "File of the tokens, see access.token_file");
    return command;
  };
  CLI::App* create = add("create", "Print a new token. It is not stored and cannot be printed again", Choice::kCreate);
  create->add_option("--tenant", tenant_, "Whose sessions the token gives access to")->required();
  create
      ->add_option("--role", role_,
                   "viewer = read sessions, owner = also create, feed and delete them, admin = those of all tenants")
      ->capture_default_str();
  create->add_option("--name", name_, "A name that tells tokens apart, e.g. of the robot")->capture_default_str();
  add("list", "List the tokens, without their secrets", Choice::kList);
  add("revoke", "Make a token invalid; its streams end within seconds", Choice::kRevoke)
      ->add_option("ID", id_, "As printed by the list")
      ->required();
}

int TokenCommand::Run() const {
  const std::string path = token_file_.empty() ? default_file_(data_dir_) : token_file_;
  std::error_code ignored;
  if (chosen_ == Choice::kCreate)
    std::filesystem::create_directories(std::filesystem::path(path).parent_path(), ignored);
  TokenStore tokens(path);
  absl::Status status;
  if (chosen_ == Choice::kCreate) status = CreateToken(tokens, name_, tenant_, role_);
  if (chosen_ == Choice::kList) status = ListTokens(tokens);
  if (chosen_ == Choice::kRevoke) status = tokens.Revoke(id_);
  if (!status.ok()) fmt::print(stderr, "romap-server: {}\n", Message(status));
  return ToExitCode(status);
}

}  // namespace romap::access
