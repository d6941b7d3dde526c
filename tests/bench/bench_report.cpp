// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/bench_report.h"

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace vorocast::bench {
namespace {

std::string Named(const std::map<std::string, double>& values) {
  std::string text;
  for (const auto& [name, value] : values) text += fmt::format("  {} {:.5g}", name, value);
  return text;
}

}  // namespace

double CpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::string DataFolder() {
  const char* data = std::getenv("VOROCAST_DATA");
  return (data ? std::filesystem::path(data) : std::filesystem::path(VOROCAST_SOURCE_DIR) / ".." / "shared" / "data").lexically_normal().string();
}

BenchReport::BenchReport(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--json" && i + 1 < argc) {
      json_file_ = argv[++i];
    } else {
      arguments_.emplace_back(argv[i]);
    }
  }
}

void BenchReport::Add(BenchCase bench_case) {
  fmt::print("{:<22} CPU {:.4g} s{}{}\n", bench_case.name, bench_case.cpu_s, Named(bench_case.quality),
             bench_case.input.empty() ? "" : fmt::format("  ({})", bench_case.input));
  if (!bench_case.goal.empty()) fmt::print("{:<22}{}\n", "  goal", Named(bench_case.goal));
  if (!bench_case.peer.empty()) {
    fmt::print("{:<22} {}{}{}\n", "  peer", bench_case.peer, bench_case.peer_cpu_s ? fmt::format(": CPU {:.4g} s", *bench_case.peer_cpu_s) : "",
               Named(bench_case.peer_quality));
  }
  std::fflush(stdout);
  cases_.push_back(std::move(bench_case));
}

void BenchReport::Skip(const std::string& name, const std::string& reason) const {
  fmt::print("{:<22} skipped: {}\n", name, reason);
  std::fflush(stdout);
}

absl::Status BenchReport::Write() const {
  if (json_file_.empty()) return absl::OkStatus();
  nlohmann::json list = nlohmann::json::array();
  for (const BenchCase& one : cases_) {
    list.push_back({{"case", one.name},
                    {"input", one.input},
                    {"cpu_s", one.cpu_s},
                    {"quality", one.quality},
                    {"goal", one.goal},
                    {"peer", one.peer.empty() ? nlohmann::json() : nlohmann::json(one.peer)},
                    {"peer_cpu_s", one.peer_cpu_s ? nlohmann::json(*one.peer_cpu_s) : nlohmann::json()},
                    {"peer_quality", one.peer_quality}});
  }
  std::ofstream file(json_file_);
  file << list.dump(2) << "\n";
  if (!file.flush()) return absl::UnknownError(fmt::format("{}: could not be written; is the disk full?", json_file_));
  return absl::OkStatus();
}

int RunBench(const char* program, int argc, char** argv, absl::Status (*measure)(BenchReport&)) {
  BenchReport report(argc, argv);
  absl::Status status = measure(report);
  if (status.ok()) status = report.Write();
  if (!status.ok()) fmt::print(stderr, "{}: {}\n", program, std::string(status.message()));
  return status.ok() ? 0 : 1;
}

}  // namespace vorocast::bench
