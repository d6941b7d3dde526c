// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/sqlite_connection.h"

#include <cerrno>
#include <cstring>

#include <fmt/format.h>

#include "services/base/check.h"

namespace vorocast::store {

absl::StatusOr<SqliteConnection> SqliteConnection::Open(const std::filesystem::path& path) {
  SqliteConnection connection;
  connection.path_ = path.string();
  sqlite3* database = nullptr;
  const int result = sqlite3_open_v2(path.c_str(), &database, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, nullptr);
  connection.database_.reset(database);
  if (result != SQLITE_OK) return connection.Error("opening");
  sqlite3_busy_timeout(database, 10'000);
  return connection;
}

absl::Status SqliteConnection::Execute(const std::string& sql) {
  if (sqlite3_exec(get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) return Error(sql.substr(0, 40));
  return absl::OkStatus();
}

absl::Status SqliteConnection::Error(std::string_view doing) const {
  const int code = sqlite3_errcode(get()) & 0xff;
  const std::string message = fmt::format("{}: {}: {}", path_, doing, sqlite3_errmsg(get()));
  if (code == SQLITE_CORRUPT || code == SQLITE_NOTADB) {
    return absl::DataLossError(
        fmt::format("{}; the database is damaged. Restore it from a backup, or move it away: sequences have to be submitted again then, but "
                    "no result in the artifact folder is computed again",
                    message));
  }
  if (code == SQLITE_FULL || (code == SQLITE_IOERR && sqlite3_system_errno(get()) == ENOSPC)) {
    return absl::ResourceExhaustedError(fmt::format("{}; free some space: work goes on by itself once there is room", message));
  }
  return absl::UnavailableError(message);
}

absl::StatusOr<SqliteStatement> SqliteStatement::Prepare(SqliteConnection& connection, std::string_view sql) {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v3(connection.get(), sql.data(), static_cast<int>(sql.size()), SQLITE_PREPARE_PERSISTENT, &statement, nullptr) != SQLITE_OK) {
    return connection.Error(sql.substr(0, 60));
  }
  return SqliteStatement(connection, statement);
}

SqliteStatement& SqliteStatement::Bind(std::int64_t value) {
  VOROCAST_CHECK(sqlite3_bind_int64(statement_.get(), next_++, value) == SQLITE_OK);
  return *this;
}
SqliteStatement& SqliteStatement::Bind(double value) {
  VOROCAST_CHECK(sqlite3_bind_double(statement_.get(), next_++, value) == SQLITE_OK);
  return *this;
}
SqliteStatement& SqliteStatement::Bind(const std::string& value) {
  VOROCAST_CHECK(sqlite3_bind_text64(statement_.get(), next_++, value.data(), value.size(), SQLITE_TRANSIENT, SQLITE_UTF8) == SQLITE_OK);
  return *this;
}
SqliteStatement& SqliteStatement::Bind(const base::Digest& value) {
  VOROCAST_CHECK(sqlite3_bind_blob64(statement_.get(), next_++, value.bytes.data(), value.bytes.size(), SQLITE_TRANSIENT) == SQLITE_OK);
  return *this;
}
SqliteStatement& SqliteStatement::BindBlob(const std::string& value) {
  VOROCAST_CHECK(sqlite3_bind_blob64(statement_.get(), next_++, value.data(), value.size(), SQLITE_TRANSIENT) == SQLITE_OK);
  return *this;
}

absl::Status SqliteStatement::Run() {
  const int result = sqlite3_step(statement_.get());
  const absl::Status status = result == SQLITE_DONE || result == SQLITE_ROW ? absl::OkStatus() : connection_->Error("writing");
  Reset();
  return status;
}

absl::StatusOr<bool> SqliteStatement::Next() {
  const int result = sqlite3_step(statement_.get());
  if (result == SQLITE_ROW) return true;
  if (result == SQLITE_DONE) return false;
  return connection_->Error("reading");
}

void SqliteStatement::Reset() {
  sqlite3_reset(statement_.get());
  next_ = 1;
}

std::string SqliteStatement::Text(int column) const {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_.get(), column));
  return text ? std::string(text, static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))) : std::string();
}

std::string SqliteStatement::Blob(int column) const {
  const auto* bytes = static_cast<const char*>(sqlite3_column_blob(statement_.get(), column));
  return bytes ? std::string(bytes, static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))) : std::string();
}

base::Digest SqliteStatement::Digest(int column) const {
  base::Digest digest;
  const void* bytes = sqlite3_column_blob(statement_.get(), column);
  if (bytes && sqlite3_column_bytes(statement_.get(), column) == static_cast<int>(digest.bytes.size())) {
    std::memcpy(digest.bytes.data(), bytes, digest.bytes.size());
  }
  return digest;
}

}  // namespace vorocast::store
