// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/telemetry/log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace vorocast::telemetry {
namespace {

nlohmann::json Line(std::string_view message) { return nlohmann::json::parse(LogLineAsJson("now", "info", "scheduler", message)); }

TEST(Log, AMessageBecomesOneObject) {
  const auto line = Line("task failed: job=j12 task=\"frame 412: tessellate\" cause=\"bad input\" attempt=7 worker=farm-3");
  EXPECT_EQ(line["time"], "now");
  EXPECT_EQ(line["level"], "info");
  EXPECT_EQ(line["process"], "scheduler");
  EXPECT_EQ(line["job"], "j12");
  EXPECT_EQ(line["task"], "frame 412: tessellate");
  EXPECT_EQ(line["attempt"], "7");
  EXPECT_EQ(line["worker"], "farm-3");
  EXPECT_EQ(line["message"], "task failed: job=j12 task=\"frame 412: tessellate\" cause=\"bad input\" attempt=7 worker=farm-3");
}

TEST(Log, WhatIsNotThereIsLeftOut) {
  EXPECT_FALSE(Line("stopped").contains("job"));
  EXPECT_FALSE(Line("look at my_job=7").contains("job"));
  EXPECT_FALSE(Line("failed: message=\"a job=7 inside of quotes\"").contains("job"));
}

TEST(Log, AnyBytesMakeOneLine) {
  const std::string text = LogLineAsJson("now", "info", "worker", "a\nb\xff\x01\"c\" task=\"never closed");
  EXPECT_EQ(text.find('\n'), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(text)["task"], "never closed");
}

TEST(Log, RefusesWhatItDoesNotKnow) {
  EXPECT_EQ(StartLog({.process = "test", .format = "xml"}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(StartLog({.process = "test", .level = "loud"}).code(), absl::StatusCode::kInvalidArgument);
}

TEST(Log, WritesObjectsOfTheLevelAskedFor) {
  const auto folder = std::filesystem::temp_directory_path() / fmt::format("vorocast_log_{}", getpid());
  ASSERT_TRUE(StartLog({.process = "test", .format = "json", .level = "warn", .file = folder / "logs" / "test.log"}).ok());
  spdlog::info("not this");
  spdlog::warn("but this: job=j1");
  spdlog::error("and this");
  std::ifstream file(folder / "logs" / "test.log");
  std::vector<nlohmann::json> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(nlohmann::json::parse(line));
  std::filesystem::remove_all(folder);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0]["level"], "warning");
  EXPECT_EQ(lines[0]["job"], "j1");
  EXPECT_EQ(lines[1]["level"], "error");
}

}  // namespace
}  // namespace vorocast::telemetry
