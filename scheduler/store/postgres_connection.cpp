// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/postgres_connection.h"

#include <libpq-fe.h>

#include <cstdlib>
#include <string_view>

#include <fmt/format.h>

namespace vorocast::store {
namespace {

/// Raised by the function that checks the term.
constexpr std::string_view kFenced = "VC001";

/// A holder of the advisory lock that dies inside a query would keep the lock until the query's end without the connection check. A host that
/// dies is noticed within seconds, and nothing waits for ever.
constexpr const char* kSettings =
    "SET client_connection_check_interval = 500; SET statement_timeout = 60000; SET idle_in_transaction_session_timeout = 10000; "
    "SET tcp_keepalives_idle = 3; SET tcp_keepalives_interval = 2; SET tcp_keepalives_count = 3; SET client_min_messages = warning; "
    "SET client_encoding = 'UTF8'; SET standard_conforming_strings = on";

/// libpq ends its messages with a line break, and some have several lines.
std::string OneLine(std::string_view message) {
  std::string line(message);
  while (!line.empty() && line.back() == '\n') line.pop_back();
  for (char& c : line) {
    if (c == '\n') c = ' ';
  }
  return line;
}

std::vector<const char*> Pointers(const PostgresParameters& parameters) {
  std::vector<const char*> pointers;
  for (const std::string& value : parameters.values()) pointers.push_back(value.c_str());
  return pointers;
}

struct ClearResult {
  void operator()(PGresult* result) const { PQclear(result); }
};
using Result = std::unique_ptr<PGresult, ClearResult>;

bool Succeeded(const PGresult* result) {
  const ExecStatusType status = PQresultStatus(result);
  return status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK || status == PGRES_PIPELINE_SYNC;
}

}  // namespace

void PostgresArray::Separate() {
  if (text_.size() > 1) text_.push_back(',');
}
void PostgresArray::Add(std::string_view text) {
  Separate();
  text_.push_back('"');
  for (const char c : text) {
    if (c == '"' || c == '\\') text_.push_back('\\');
    // The server refuses a zero byte in text; a message with one is better kept without it than not at all.
    if (c != '\0') text_.push_back(c);
  }
  text_.push_back('"');
}
void PostgresArray::Add(const base::Digest& digest) {
  Separate();
  text_.append("\"\\\\x").append(digest.Hex()).push_back('"');
}
void PostgresArray::AddBytes(std::string_view bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  Separate();
  text_.append("\"\\\\x");
  for (const char c : bytes) {
    text_.push_back(kDigits[static_cast<unsigned char>(c) >> 4]);
    text_.push_back(kDigits[static_cast<unsigned char>(c) & 15]);
  }
  text_.push_back('"');
}
void PostgresArray::Add(std::int64_t value) {
  Separate();
  text_.append(std::to_string(value));
}
void PostgresArray::Add(double value) {
  Separate();
  text_.append(fmt::format("{}", value));
}

PostgresRows::PostgresRows(pg_result* result) : result_(result) {}
void PostgresRows::Clear::operator()(pg_result* result) const { PQclear(result); }
int PostgresRows::size() const { return PQntuples(result_.get()); }
std::string PostgresRows::Text(int row, int column) const {
  return {PQgetvalue(result_.get(), row, column), static_cast<std::size_t>(PQgetlength(result_.get(), row, column))};
}
std::int64_t PostgresRows::Integer(int row, int column) const { return std::strtoll(PQgetvalue(result_.get(), row, column), nullptr, 10); }
double PostgresRows::Number(int row, int column) const { return std::strtod(PQgetvalue(result_.get(), row, column), nullptr); }
base::Digest PostgresRows::Digest(int row, int column) const {
  const auto digest = base::Digest::FromHex(Text(row, column));
  return digest.ok() ? *digest : base::Digest{};
}
std::string PostgresRows::Bytes(int row, int column) const {
  std::size_t size = 0;
  unsigned char* bytes = PQunescapeBytea(reinterpret_cast<const unsigned char*>(PQgetvalue(result_.get(), row, column)), &size);
  if (!bytes) return {};
  std::string text(reinterpret_cast<const char*>(bytes), size);
  PQfreemem(bytes);
  return text;
}

void PostgresConnection::Finish::operator()(pg_conn* connection) const { PQfinish(connection); }

absl::Status PostgresConnection::Open() {
  if (connection_ && PQstatus(connection_.get()) == CONNECTION_OK) return absl::OkStatus();
  // What stands before dbname, the URL may say otherwise.
  const char* const words[] = {"connect_timeout",  "keepalives_idle", "keepalives_interval", "keepalives_count",
                               "tcp_user_timeout", "dbname",          "application_name",    nullptr};
  const char* const values[] = {"5", "3", "2", "3", "10000", url_.c_str(), application_.c_str(), nullptr};
  connection_.reset(PQconnectdbParams(words, values, 1));
  if (PQstatus(connection_.get()) == CONNECTION_OK) {
    const Result result(PQexec(connection_.get(), kSettings));
    if (Succeeded(result.get())) return absl::OkStatus();
  }
  const std::string message = OneLine(PQerrorMessage(connection_.get()));
  connection_.reset();
  return absl::UnavailableError(fmt::format("the database cannot be reached: {}", message));
}

absl::Status PostgresConnection::Error(const pg_result* result) {
  const char* field = result ? PQresultErrorField(result, PG_DIAG_SQLSTATE) : nullptr;
  const std::string_view state = field ? field : "";
  const std::string message = OneLine(result && field ? PQresultErrorMessage(result) : PQerrorMessage(connection_.get()));
  const std::string said = fmt::format("database {}: {}", PQdb(connection_.get()), message);
  if (PQstatus(connection_.get()) != CONNECTION_OK || PQpipelineStatus(connection_.get()) != PQ_PIPELINE_OFF) connection_.reset();
  if (state == kFenced) return absl::FailedPreconditionError(said);
  if (state.starts_with("XX")) return absl::DataLossError(fmt::format("{}; the database is damaged, restore it from a backup", said));
  if (state.starts_with("53")) return absl::ResourceExhaustedError(fmt::format("{}; work goes on by itself once there is room", said));
  return absl::UnavailableError(said);
}

absl::StatusOr<PostgresRows> PostgresConnection::Ask(const PostgresStatement& statement) {
  RETURN_IF_ERROR(Open());
  const auto pointers = Pointers(statement.parameters);
  Result result(
      PQexecParams(connection_.get(), statement.sql, static_cast<int>(pointers.size()), nullptr, pointers.data(), nullptr, nullptr, /*text*/ 0));
  if (!Succeeded(result.get())) return Error(result.get());
  return PostgresRows(result.release());
}

absl::Status PostgresConnection::Execute(const std::string& sql) {
  RETURN_IF_ERROR(Open());
  const Result result(PQexec(connection_.get(), sql.c_str()));
  return Succeeded(result.get()) ? absl::OkStatus() : Error(result.get());
}

absl::Status PostgresConnection::RunAtOnce(const std::vector<PostgresStatement>& statements) {
  RETURN_IF_ERROR(Open());
  PGconn* const connection = connection_.get();
  // Everything up to the sync is one transaction of the server's own making: the first error takes all of it back.
  bool sent = PQenterPipelineMode(connection) == 1;
  for (const PostgresStatement& statement : statements) {
    const auto pointers = Pointers(statement.parameters);
    sent =
        sent && PQsendQueryParams(connection, statement.sql, static_cast<int>(pointers.size()), nullptr, pointers.data(), nullptr, nullptr, 0) == 1;
  }
  sent = sent && PQpipelineSync(connection) == 1;
  if (!sent) {
    const absl::Status status = Error(nullptr);
    connection_.reset();
    return status;
  }
  Result first_error;
  bool synced = false;
  // Each statement's answer ends with a null; the sync's has none after it.
  for (int nulls = 0; !synced && nulls < 2;) {
    Result result(PQgetResult(connection));
    if (!result) {
      ++nulls;
      continue;
    }
    nulls = 0;
    synced = PQresultStatus(result.get()) == PGRES_PIPELINE_SYNC;
    if (!Succeeded(result.get()) && !first_error) first_error = std::move(result);
  }
  if (synced) PQexitPipelineMode(connection);
  if (!first_error && synced) return absl::OkStatus();
  const absl::Status status = Error(first_error.get());
  if (!synced) connection_.reset();
  return status;
}

absl::Status CheckPostgresUrl(const std::string& url) {
  char* problem = nullptr;
  PQconninfoOption* const options = PQconninfoParse(url.c_str(), &problem);
  if (!options) {
    const std::string why = problem ? OneLine(problem) : "out of memory";
    PQfreemem(problem);
    return absl::InvalidArgumentError(fmt::format("the database's URL is wrong: {}; it looks like postgresql://USER@HOST/NAME", why));
  }
  bool password = false;
  for (const PQconninfoOption* option = options; option->keyword; ++option) {
    password = password || (std::string_view(option->keyword) == "password" && option->val && *option->val);
  }
  PQconninfoFree(options);
  if (!password) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "the database's URL holds a password, which everyone on this machine can read in the list of processes; put it into ~/.pgpass or PGPASSWORD");
}

}  // namespace vorocast::store
