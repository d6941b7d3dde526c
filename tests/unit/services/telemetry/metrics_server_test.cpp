// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/telemetry/metrics_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <prometheus/counter.h>

#include <algorithm>

#include "tests/support/scrape.h"

namespace vorocast::telemetry {
namespace {

TEST(MetricsServer, AnswersAScrape) {
  auto registry = std::make_shared<prometheus::Registry>();
  AddBuildInformation(*registry, "test");
  prometheus::BuildCounter().Name("vorocast_things_total").Help("Things").Register(*registry).Add({{"kind", "a \"b\""}}).Increment(3);
  const auto server = MetricsServer::Start("0", registry);
  ASSERT_TRUE(server.ok()) << server.status();
  EXPECT_TRUE((*server)->address().starts_with("127.0.0.1:"));
  const auto samples = support::Scrape((*server)->address());
  EXPECT_EQ(samples.at("vorocast_things_total{kind=\"a \\\"b\\\"\"}"), 3);
  EXPECT_EQ(std::count_if(samples.begin(), samples.end(), [](const auto& s) { return s.first.starts_with("vorocast_build_info{"); }), 1);
  EXPECT_EQ(MetricsServer::Start((*server)->address(), registry).status().code(), absl::StatusCode::kUnavailable);
}

TEST(MetricsServer, KnowsAddresses) {
  EXPECT_EQ(*ParseMetricsAddress("9100"), "127.0.0.1:9100");
  EXPECT_EQ(*ParseMetricsAddress(":9100"), "127.0.0.1:9100");
  EXPECT_EQ(*ParseMetricsAddress("localhost:1"), "127.0.0.1:1");
  EXPECT_EQ(*ParseMetricsAddress("0.0.0.0:9100"), "0.0.0.0:9100");
  for (const char* wrong : {"", "a:b", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1", "farm:9100", "1,2", "127.0.0.1:80s"}) {
    EXPECT_EQ(ParseMetricsAddress(wrong).status().code(), absl::StatusCode::kInvalidArgument) << wrong;
  }
}

}  // namespace
}  // namespace vorocast::telemetry
