// SPDX-License-Identifier: AGPL-3.0-or-later
#include <memory>
#include <string>
#include <vector>

#include "services/client/commands.h"
#include "services/client/embedded_service.h"
#include "services/client/programs.h"
#include "services/client/run_job.h"
#include "services/rpc/security_flags.h"

namespace vorocast::client {
namespace {

void AddServe(CLI::App& program, int& exit_code) {
  struct Flags {
    std::string state, database, listen = "127.0.0.1:7400";
    rpc::ServerSecurity security;
    std::int32_t workers = 0;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App& command = *program.add_subcommand("serve", "Run a scheduler that others submit to, with workers of its own if wanted");
  command.add_option("--state", flags->state, "Folder for state and results (~/.cache/vorocast)");
  command
      .add_option("--listen", flags->listen,
                  "Address: HOST:PORT or unix:/PATH. For other machines give certificates and tokens too (docs/operations.md)")
      ->capture_default_str();
  rpc::AddServerSecurityFlags(command, flags->security);
  command.add_option("--database", flags->database,
                     "postgresql://USER@HOST/NAME instead of SQLite in the state folder; a second scheduler on the same database stands by");
  command.add_option("--workers", flags->workers, "Workers to start on this machine beside it, with one simulation; 0: none")
      ->capture_default_str()
      ->check(CLI::Range(0, 1024));
  command.allow_extras();
  command.footer(
      "Further flags go to vorocast-scheduler as they are: where its workers come from (--fleet slurm, --workers-max 64), --metrics, --log-format,\n"
      "what is kept for how long (--keep-days, --disk-limit). 'vorocast-scheduler --help' lists them.");
  command.callback([flags, &command, &exit_code] {
    std::vector<std::string> arguments = {"--state", flags->state.empty() ? DefaultStateFolder().string() : flags->state, "--listen", flags->listen};
    if (!flags->database.empty()) arguments.insert(arguments.end(), {"--database", flags->database});
    if (flags->workers > 0) arguments.insert(arguments.end(), {"--workers", std::to_string(flags->workers), "--simulation"});
    const std::vector<std::string> security = rpc::ArgumentsOf(flags->security);
    arguments.insert(arguments.end(), security.begin(), security.end());
    const std::vector<std::string> further = command.remaining();
    arguments.insert(arguments.end(), further.begin(), further.end());
    exit_code = PrintError(BecomeProgram("vorocast-scheduler", arguments));
  });
}

void AddWorker(CLI::App& program, int& exit_code) {
  struct Flags {
    std::string scheduler, cache;
    rpc::ClientSecurityFlags security;
    std::int32_t slots = 1;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App& command = *program.add_subcommand("worker", "Take tasks from a scheduler until stopped");
  command.add_option("--scheduler", flags->scheduler, "Its address, HOST:PORT; A,B where one stands by")->required();
  command.add_option("--slots", flags->slots, "Tasks at once")->capture_default_str()->check(CLI::Range(1, 1024));
  command.add_option("--cache", flags->cache,
                     "For a machine that does not see the scheduler's state folder: files come and go through the scheduler and this folder");
  flags->security.AddTo(command);
  command.callback([flags, &exit_code] {
    std::vector<std::string> arguments = {"--scheduler", flags->scheduler, "--slots", std::to_string(flags->slots)};
    if (!flags->cache.empty()) arguments.insert(arguments.end(), {"--artifacts", "remote", "--cache", flags->cache});
    const std::vector<std::string> security = rpc::ArgumentsOf(flags->security.Get());
    arguments.insert(arguments.end(), security.begin(), security.end());
    exit_code = PrintError(BecomeProgram("vorocast-worker", arguments));
  });
}

}  // namespace

void AddServiceCommands(CLI::App& program, int& exit_code) {
  AddServe(program, exit_code);
  AddWorker(program, exit_code);
}

}  // namespace vorocast::client
