// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/programs.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>

#include <fmt/format.h>

namespace vorocast::client {

absl::StatusOr<std::filesystem::path> ProgramBeside(const std::string& name) {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return absl::InternalError(fmt::format("/proc/self/exe: {}", error.message()));
  std::filesystem::path program = self.parent_path() / name;
  if (!std::filesystem::exists(program, error)) {
    return absl::NotFoundError(
        fmt::format("{} is not in {}: install all of Vorocast's programs into one folder (make build puts them into build/bin)", name,
                    self.parent_path().string()));
  }
  return program;
}

absl::Status BecomeProgram(const std::string& name, const std::vector<std::string>& arguments) {
  ASSIGN_OR_RETURN(const std::filesystem::path program, ProgramBeside(name));
  std::vector<char*> argv = {const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  execv(program.c_str(), argv.data());
  return absl::InternalError(fmt::format("cannot run {}: {}", program.string(), std::strerror(errno)));
}

}  // namespace vorocast::client
