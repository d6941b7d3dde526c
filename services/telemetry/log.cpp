// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/telemetry/log.h"

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <spdlog/formatter.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "absl/time/time.h"

namespace vorocast::telemetry {
namespace {

constexpr std::array<std::string_view, 4> kFields = {"job", "task", "attempt", "worker"};

/// The value after "key=", quoted or up to the next blank; the first that stands at a word's beginning and outside of quotes.
std::optional<std::string_view> FindField(std::string_view message, std::string_view key) {
  bool quoted = false;
  for (std::size_t i = 0; i < message.size(); ++i) {
    const bool begins = i == 0 || message[i - 1] == ' ';
    if (!quoted && begins && message.substr(i).starts_with(key) && message.substr(i + key.size()).starts_with('=')) {
      std::string_view value = message.substr(i + key.size() + 1);
      const char end = value.starts_with('"') ? '"' : ' ';
      if (end == '"') value.remove_prefix(1);
      return value.substr(0, value.find(end));
    }
    if (message[i] == '"') quoted = !quoted;
  }
  return std::nullopt;
}

std::string_view LevelName(spdlog::level::level_enum level) {
  const auto name = spdlog::level::to_string_view(level);
  return {name.data(), name.size()};
}

class JsonFormatter final : public spdlog::formatter {
 public:
  explicit JsonFormatter(std::string process) : process_(std::move(process)) {}

  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& out) override {
    const std::string time = absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", absl::FromChrono(message.time), absl::UTCTimeZone());
    const std::string line = LogLineAsJson(time, LevelName(message.level), process_, {message.payload.data(), message.payload.size()});
    out.append(line.data(), line.data() + line.size());
    out.push_back('\n');
  }
  std::unique_ptr<spdlog::formatter> clone() const override { return std::make_unique<JsonFormatter>(process_); }

 private:
  const std::string process_;
};

/// spdlog takes any name it does not know for "off".
absl::StatusOr<spdlog::level::level_enum> ParseLevel(const std::string& name) {
  if (name == "debug") return spdlog::level::debug;
  if (name == "info") return spdlog::level::info;
  if (name == "warn") return spdlog::level::warn;
  if (name == "error") return spdlog::level::err;
  return absl::InvalidArgumentError(fmt::format("\"{}\" is no level of the log; choose debug, info, warn or error", name));
}

}  // namespace

std::string LogLineAsJson(std::string_view time, std::string_view level, std::string_view process, std::string_view message) {
  nlohmann::ordered_json line = {{"time", time}, {"level", level}, {"process", process}};
  for (const std::string_view key : kFields) {
    if (const auto value = FindField(message, key)) line[std::string(key)] = *value;
  }
  line["message"] = message;
  return line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

absl::Status StartLog(const LogOptions& options) {
  if (options.format != "text" && options.format != "json") {
    return absl::InvalidArgumentError(fmt::format("\"{}\" is no format of the log; choose text or json", options.format));
  }
  ASSIGN_OR_RETURN(const spdlog::level::level_enum level, ParseLevel(options.level));
  try {
    std::vector<spdlog::sink_ptr> sinks = {std::make_shared<spdlog::sinks::stderr_sink_mt>()};
    if (!options.file.empty()) {
      std::error_code error;
      std::filesystem::create_directories(options.file.parent_path(), error);
      if (error) return absl::UnavailableError(fmt::format("{}: cannot be created: {}", options.file.parent_path().string(), error.message()));
      sinks.push_back(std::make_shared<spdlog::sinks::basic_file_sink_mt>(options.file.string()));
    }
    auto logger = std::make_shared<spdlog::logger>(options.process, sinks.begin(), sinks.end());
    if (options.format == "json") {
      logger->set_formatter(std::make_unique<JsonFormatter>(options.process));
    } else {
      logger->set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %l %v");
    }
    logger->set_level(level);
    logger->flush_on(spdlog::level::debug);
    spdlog::set_default_logger(std::move(logger));
  } catch (const spdlog::spdlog_ex& problem) {
    return absl::UnavailableError(problem.what());
  }
  return absl::OkStatus();
}

}  // namespace vorocast::telemetry
