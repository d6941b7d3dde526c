// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "services/base/digest.h"
#include "services/base/status.h"

namespace vorocast::store {

/// One open database; used by one thread at a time.
class SqliteConnection {
 public:
  static absl::StatusOr<SqliteConnection> Open(const std::filesystem::path& path);

  absl::Status Execute(const std::string& sql);
  /// The last error as a status: DATA_LOSS for a damaged file, RESOURCE_EXHAUSTED for a full disk, else UNAVAILABLE; with the path.
  absl::Status Error(std::string_view doing) const;
  sqlite3* get() const { return database_.get(); }
  const std::string& path() const { return path_; }

 private:
  struct Close {
    void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
  };
  std::unique_ptr<sqlite3, Close> database_;
  std::string path_;
};

/// A prepared statement. Bind() in order, then Run() or Next(), then Reset() to use it again.
class SqliteStatement {
 public:
  static absl::StatusOr<SqliteStatement> Prepare(SqliteConnection& connection, std::string_view sql);

  SqliteStatement& Bind(std::int64_t value);
  SqliteStatement& Bind(std::int32_t value) { return Bind(static_cast<std::int64_t>(value)); }
  SqliteStatement& Bind(double value);
  SqliteStatement& Bind(const std::string& value);
  SqliteStatement& Bind(const base::Digest& value);
  /// Bytes rather than text.
  SqliteStatement& BindBlob(const std::string& value);

  /// To the end, then reset.
  absl::Status Run();
  /// To the next row; false after the last.
  absl::StatusOr<bool> Next();
  void Reset();

  std::int64_t Integer(int column) const { return sqlite3_column_int64(statement_.get(), column); }
  double Number(int column) const { return sqlite3_column_double(statement_.get(), column); }
  std::string Text(int column) const;
  std::string Blob(int column) const;
  /// Zeros if the column does not hold 32 bytes.
  base::Digest Digest(int column) const;

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  SqliteStatement(SqliteConnection& connection, sqlite3_stmt* statement) : connection_(&connection), statement_(statement) {}

  SqliteConnection* connection_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
  int next_ = 1;
};

}  // namespace vorocast::store
