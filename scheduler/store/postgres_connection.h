// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "services/base/digest.h"
#include "services/base/status.h"

// libpq's own handles, so that its header stays in this folder's sources.
struct pg_conn;
struct pg_result;

namespace vorocast::store {

/// Parameters of one statement, all sent as text; arrays as PostgreSQL's array literals.
class PostgresParameters {
 public:
  PostgresParameters& Add(std::string text) {
    values_.push_back(std::move(text));
    return *this;
  }
  PostgresParameters& Add(std::int64_t value) { return Add(std::to_string(value)); }
  const std::vector<std::string>& values() const { return values_; }

 private:
  std::vector<std::string> values_;
};

/// Grows an array literal: {"a","b\"c",12,"\\x00ff"}.
class PostgresArray {
 public:
  void Add(std::string_view text);
  void Add(const base::Digest& digest);
  void AddBytes(std::string_view bytes);
  void Add(std::int64_t value);
  void Add(double value);
  bool empty() const { return text_.size() == 1; }
  std::string Take() { return std::move(text_) + "}"; }

 private:
  void Separate();
  std::string text_ = "{";
};

/// The rows of one answer.
class PostgresRows {
 public:
  explicit PostgresRows(pg_result* result);
  int size() const;
  std::string Text(int row, int column) const;
  std::int64_t Integer(int row, int column) const;
  double Number(int row, int column) const;
  bool Truth(int row, int column) const { return Text(row, column) == "t"; }
  /// Of a column that was selected as encode(…, 'hex'); zeros if it does not hold 32 bytes.
  base::Digest Digest(int row, int column) const;
  /// Of a bytea column.
  std::string Bytes(int row, int column) const;

 private:
  struct Clear {
    void operator()(pg_result* result) const;
  };
  std::unique_ptr<pg_result, Clear> result_;
};

struct PostgresStatement {
  const char* sql = "";
  PostgresParameters parameters;
};

/// One connection, opened when it is first needed and again after it broke; used by one thread at a time. Every wait for the server has an
/// end: a server that does not answer is UNAVAILABLE within seconds.
class PostgresConnection {
 public:
  /// `url` without a password; `application` is the name that the server shows.
  PostgresConnection(std::string url, std::string application) : url_(std::move(url)), application_(std::move(application)) {}

  absl::StatusOr<PostgresRows> Ask(const PostgresStatement& statement);
  /// Several statements without parameters, one transaction.
  absl::Status Execute(const std::string& sql);
  /// All of the statements or none, in one round trip.
  absl::Status RunAtOnce(const std::vector<PostgresStatement>& statements);
  void Close() { connection_.reset(); }
  bool is_open() const { return connection_ != nullptr; }

 private:
  struct Finish {
    void operator()(pg_conn* connection) const;
  };
  absl::Status Open();
  /// By the SQLSTATE; closes a connection that is broken.
  absl::Status Error(const pg_result* result);

  std::string url_;
  std::string application_;
  std::unique_ptr<pg_conn, Finish> connection_;
};

/// INVALID_ARGUMENT for what is no PostgreSQL URL, and for one with a password: everyone on the machine could read it.
absl::Status CheckPostgresUrl(const std::string& url);

}  // namespace vorocast::store
