// SPDX-License-Identifier: AGPL-3.0-or-later
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "services/client/commands.h"
#include "services/client/run_job.h"
#include "services/rpc/tokens.h"

namespace vorocast::client {

void AddTokenCommand(CLI::App& program, int& exit_code) {
  struct Flags {
    std::string name;
    std::vector<std::string> roles;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App& token = *program.add_subcommand("token", "Make the tokens by which a scheduler knows who calls");
  token.require_subcommand(1);
  CLI::App& command = *token.add_subcommand("new", "Make a random token, and the line that lets it in");
  command.add_option("name", flags->name, "Whose it is: jobs submitted with it belong to this name")->required();
  command
      .add_option("--role", flags->roles,
                  "submit (and see all jobs), operate (change everybody's jobs too), work (take tasks) or read (see all jobs); may be given again")
      ->required()
      ->allow_extra_args(false);
  command.footer(
      "The token goes to standard output, for its owner's --token-file; it is kept nowhere else. The line goes to standard error, for the\n"
      "scheduler's --tokens file, which is read again when it changes. To withdraw a token, remove its line.\n"
      "Example: vorocast token new stage --role submit > stage.token");
  command.callback([flags, &exit_code] {
    const auto make = [&]() -> absl::Status {
      rpc::Roles roles;
      for (const std::string& name : flags->roles) {
        ASSIGN_OR_RETURN(const rpc::Role role, rpc::RoleFromName(name));
        roles.Add(role);
      }
      ASSIGN_OR_RETURN(const rpc::NewToken made, rpc::MakeToken(flags->name, roles));
      fmt::print("{}\n", made.token);
      std::fflush(stdout);
      fmt::print(stderr, "Add this line to the scheduler's tokens file:\n{}\n", made.line);
      return absl::OkStatus();
    };
    const absl::Status status = make();
    exit_code = status.ok() ? 0 : PrintError(status);
  });
}

}  // namespace vorocast::client
