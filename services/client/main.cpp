// SPDX-License-Identifier: AGPL-3.0-or-later
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "services/base/processor.h"
#include "services/client/commands.h"

namespace {

/// "--up -y" would read as two flags: an axis is joined to the flag it belongs to.
std::vector<std::string> JoinAxis(int argc, char** argv) {
  std::vector<std::string> arguments;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--up" && i + 1 < argc) {
      arguments.push_back(std::string("--up=") + argv[++i]);
    } else {
      arguments.emplace_back(argv[i]);
    }
  }
  return {arguments.rbegin(), arguments.rend()};  // CLI11 takes its vector back to front
}

}  // namespace

int main(int argc, char** argv) {
  vorocast::base::RequireProcessor();
  CLI::App program{"Vorocast turns captured performances into volumetric animation: Voronoi cells, tracked through a take, handed to physics."};
  program.name("vorocast");
  program.require_subcommand(1);
  program.set_version_flag("--version", "vorocast " VOROCAST_VERSION);
  program.footer(
      "First steps: 'vorocast demo' makes up a capture and does everything with it; 'vorocast inspect FOLDER' looks at your own;\n"
      "'vorocast run FOLDER --effect pendulum' does everything with it. Each command has --help.");
  int exit_code = 0;
  vorocast::client::AddRunCommands(program, exit_code);
  vorocast::client::AddCaptureCommands(program, exit_code);
  vorocast::client::AddJobCommands(program, exit_code);
  vorocast::client::AddLogCommands(program, exit_code);
  vorocast::client::AddReportCommand(program, exit_code);
  vorocast::client::AddExportCommand(program, exit_code);
  vorocast::client::AddServiceCommands(program, exit_code);
  vorocast::client::AddTokenCommand(program, exit_code);
  try {
    program.parse(JoinAxis(argc, argv));
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  }
  return exit_code;
}
