// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "absl/time/time.h"
#include "scheduler/core/event.h"
#include "scheduler/core/record.h"

namespace vorocast::core {

/// Does a result of this key exist already? Answered by LookUpAnswered, some time.
struct LookUp {
  base::Digest key;
  std::string extension;
  bool verify = false;  // an existing file's bytes too
};

struct Lease {
  AttemptId id;
  std::string label;
  std::string spec_json;
  std::int64_t memory_limit = 0;  // bytes
  absl::Duration time_limit;
};

struct Welcome {
  std::vector<AttemptId> go_on;
  std::vector<AttemptId> drop;
};
struct Leases {
  std::vector<Lease> leases;
};
struct Acknowledge {
  std::vector<AttemptId> ids;
};
struct Revoke {
  std::vector<AttemptId> ids;
};

/// To a worker's stream; dropped when that stream is gone.
struct Message {
  ConnectionId connection = 0;
  std::variant<Welcome, Leases, Acknowledge, Revoke> content;
};

/// What a step wants done. The records must be durable before a message leaves.
struct Effects {
  std::vector<Record> records;
  std::vector<LookUp> look_ups;
  std::vector<Message> messages;
  std::vector<std::string> changed_jobs;  // sorted, each once
};

}  // namespace vorocast::core
