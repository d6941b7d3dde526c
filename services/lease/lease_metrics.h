// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include <prometheus/counter.h>
#include <prometheus/family.h>
#include <prometheus/gauge.h>
#include <prometheus/registry.h>

#include "proto/dispatch.pb.h"

namespace vorocast::lease {

/// What a process that takes leases counts about itself (docs/operations.md lists the names). From one thread; scrapes come from any.
class LeaseMetrics {
 public:
  LeaseMetrics(const std::string& process, std::int32_t slots);

  void SetConnected(bool connected) { connected_.Set(connected ? 1 : 0); }
  void SetBusy(std::size_t attempts) { busy_.Set(static_cast<double>(attempts)); }
  void AttemptEnded(const v1::Finished& finished);

  const std::shared_ptr<prometheus::Registry>& registry() const { return registry_; }

 private:
  std::shared_ptr<prometheus::Registry> registry_ = std::make_shared<prometheus::Registry>();
  prometheus::Gauge& slots_;
  prometheus::Gauge& busy_;
  prometheus::Gauge& connected_;
  prometheus::Family<prometheus::Counter>& attempts_;
  prometheus::Counter& seconds_;
};

}  // namespace vorocast::lease
