// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "services/lease/executor.h"
#include "services/storage/hdf5_artifacts.h"

namespace vorocast::lease {

/// A made-up kind of simulation that does what the effect's field "do" says. Named pipes let a test hold it and see it die.
class ObedientExecutor : public Executor {
 public:
  tasks::Kind kind() const override { return tasks::Kind::kSimulate; }

  absl::Status Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore&, const std::filesystem::path& output,
                       const base::Progress& progress) override {
    const nlohmann::json& effect = spec.options["effect"];
    const std::string what = effect.value("do", "");
    if (what == "refuse") return absl::InvalidArgumentError("3 of 65386 normals are not finite");
    if (what == "lose the store") return absl::UnavailableError("the folder is away");
    if (what == "throw") throw std::runtime_error("a library threw");
    if (what == "write nonsense") {
      std::ofstream(output) << "not HDF5";
      return absl::OkStatus();
    }
    if (what == "chatter") {
      std::printf("{\"code\": 13, \"message\": \"a library that prints\"}\n");
      std::fflush(stdout);
    }
    if (what == "print a lot") {
      for (int line = 0; line < 100'000; ++line) std::fprintf(stderr, "line %d\n", line);
      std::fprintf(stderr, "\xff the last words\n");
      return absl::InvalidArgumentError("it was too much");
    }
    if (what == "crash") {
      std::fprintf(stderr, "the last words\n");
      ::raise(SIGSEGV);
    }
    if (what == "eat memory") {
      std::vector<std::vector<char>> eaten;
      for (;;) eaten.emplace_back(16 << 20, 'x');
    }
    if (what == "wait") {
      base::Report(progress, 0.5);
      char byte;  // comes when the test lets go
      std::ifstream(effect["pipe"].get<std::string>()).get(byte);
    }
    if (what == "hang") {
      std::ofstream pipe(effect["pipe"].get<std::string>());
      pipe << "alive\n" << std::flush;
      for (;;) ::pause();
    }
    geometry::SimulatedTake take;
    take.effect_json = effect.dump();
    take.time = {0};
    return storage::WriteSimulatedTake(output, take, {});
  }
};

}  // namespace vorocast::lease
