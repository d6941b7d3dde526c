// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace vorocast::bench {

// One figure of one kernel: what it cost on one core, how good its result is, what was aimed at, and what another program needs for the same work.
struct BenchCase {
  std::string name;   // "cvt-5000-10": kernel, size, iterations
  std::string input;  // what it was measured on: "crane 0, 65386 points, 1 mm noise"
  double cpu_s = 0;
  std::map<std::string, double> quality;  // "g3", "mean_mm", "p95_mm", "drift_mm", …; units are in the name
  std::map<std::string, double>
      goal;          // "cpu_s" and names of `quality`; what is at most this is reached, and a name that begins with "min_" must be at least this
  std::string peer;  // a program or a library's function with its version; empty: no peer
  std::optional<double> peer_cpu_s;
  std::map<std::string, double> peer_quality;
};

// CPU seconds, user and system, of this process so far, all threads.
double CpuSeconds();

// The folder of captures: VOROCAST_DATA, else shared/data beside the checkout; it need not exist.
std::string DataFolder();

// Collects a program's cases, prints each as a line beside its goal and its peer, and writes them as a JSON list where `--json FILE` was given.
class BenchReport {
 public:
  // Takes `--json FILE` out of the arguments; the others stay, in their order, in arguments().
  BenchReport(int argc, char** argv);

  const std::vector<std::string>& arguments() const { return arguments_; }
  void Add(BenchCase bench_case);
  /// Says that cases cannot be measured here and why; that is no failure.
  void Skip(const std::string& name, const std::string& reason) const;

  // Errors: UNKNOWN, the file could not be written.
  absl::Status Write() const;

 private:
  std::vector<std::string> arguments_;
  std::string json_file_;
  std::vector<BenchCase> cases_;
};

/// What a benchmark's main does: measures, writes what `--json` asks for, and tells on standard error what went wrong. The program's exit code.
int RunBench(const char* program, int argc, char** argv, absl::Status (*measure)(BenchReport&));

}  // namespace vorocast::bench
