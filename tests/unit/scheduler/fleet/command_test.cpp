// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <string>

namespace vorocast::fleet {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string Message(const absl::StatusOr<std::string>& result) { return std::string(result.status().message()); }

TEST(Command, GivesWhatWasPrintedAndNoShellSeesTheArguments) {
  const auto printed = RunCommand({"printf", "%s|", "two words", "$HOME", "`id`; *"});
  ASSERT_TRUE(printed.ok()) << printed.status();
  EXPECT_EQ(*printed, "two words|$HOME|`id`; *|");
}

TEST(Command, PassesOnNoPassword) {
  setenv("PGPASSWORD", "secret", 1);
  const auto printed = RunCommand({"env"});
  unsetenv("PGPASSWORD");
  ASSERT_TRUE(printed.ok());
  EXPECT_THAT(*printed, HasSubstr("PATH="));
  EXPECT_THAT(*printed, Not(HasSubstr("secret")));
}

TEST(Command, TellsWhyItFailed) {
  EXPECT_THAT(Message(RunCommand({"sh", "-c", "echo no such partition >&2; exit 3"})), HasSubstr("code 3: no such partition"));
  EXPECT_THAT(Message(RunCommand({"sh", "-c", "kill -9 $$"})), HasSubstr("signal 9"));
  EXPECT_THAT(Message(RunCommand({"vorocast-no-such-program"})), HasSubstr("cannot be started"));
}

TEST(Command, EndsOneThatTakesTooLong) {
  EXPECT_THAT(Message(RunCommand({"sleep", "1000"}, {.time = absl::Milliseconds(50)})), HasSubstr("no answer"));
  EXPECT_THAT(Message(RunCommand({"sh", "-c", "exec >&- 2>&-; exec sleep 1000"}, {.time = absl::Milliseconds(50)})), HasSubstr("signal 9"));
}

TEST(Command, EndsOneThatPrintsTooMuch) {
  const auto printed = RunCommand({"yes"}, {.output_bytes = 1000});
  EXPECT_EQ(printed.status().code(), absl::StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace vorocast::fleet
