// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tests/cluster/programs.h"

namespace vorocast::cluster {

/// A loopback port that was free a moment ago, for what must be known before anybody listens on it.
int FreePort();

/// A farm's processes as a site starts them, apart from each other: schedulers on one state folder (two of them only with a database), workers
/// and a simulation. All die with this object.
class Farm {
 public:
  struct Options {
    std::filesystem::path folder;
    std::string database;  // empty: SQLite
    int schedulers = 1;
    int workers = 2;
  };
  /// Returns when the first scheduler leads.
  explicit Farm(const Options& options);

  std::filesystem::path state() const { return options_.folder / "state"; }
  std::filesystem::path out() const { return options_.folder / "out"; }
  /// As --to and --scheduler take it: A, or A,B.
  std::string address() const;
  const std::string& scheduler_address(int which) const { return addresses_[static_cast<std::size_t>(which)]; }

  /// "scheduler-0", "scheduler-1", "worker-0", …, "simulation".
  std::vector<std::string> names() const;
  Running& member(const std::string& name) { return *members_.at(name); }
  bool Leads(int scheduler);
  /// Starts every member again that has ended, as systemd would.
  void Revive();

  /// `vorocast submit` of the small job; `more` flags at its end.
  std::vector<std::string> SubmitArguments(const std::filesystem::path& capture, const std::vector<std::string>& more = {}) const;
  /// Fetches the newest job's results into a fresh out(), and gives their digests.
  std::map<std::string, std::string> FetchedDigests() const;

 private:
  std::unique_ptr<Running> Start(const std::string& name) const;

  Options options_;
  std::vector<std::string> addresses_;
  std::map<std::string, std::unique_ptr<Running>> members_;
};

}  // namespace vorocast::cluster
