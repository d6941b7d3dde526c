// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <CLI/CLI.hpp>

/// Each adds its subcommands to the program; a subcommand's callback sets `exit_code`.
namespace vorocast::client {

void AddRunCommands(CLI::App& program, int& exit_code);      // run, demo
void AddServiceCommands(CLI::App& program, int& exit_code);  // serve, worker
void AddJobCommands(CLI::App& program, int& exit_code);      // submit, status, watch, explain, cancel, retry, fetch
void AddLogCommands(CLI::App& program, int& exit_code);      // logs
void AddReportCommand(CLI::App& program, int& exit_code);    // report
void AddCaptureCommands(CLI::App& program, int& exit_code);  // inspect, synth
void AddExportCommand(CLI::App& program, int& exit_code);    // export
void AddTokenCommand(CLI::App& program, int& exit_code);     // token

}  // namespace vorocast::client
