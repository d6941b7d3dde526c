// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/collection_policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace vorocast::server {
namespace {

using storage::StoredFile;
using testing::ElementsAre;
using testing::IsEmpty;

const absl::Time kNow = absl::FromUnixSeconds(1'800'000'000);

StoredFile File(const std::string& name, std::int64_t size, absl::Duration age, StoredFile::What what = StoredFile::What::kResult) {
  return {.what = what, .digest = base::HashBytes(name), .extension = ".h5", .size = size, .used = kNow - age};
}
std::vector<std::int64_t> Sizes(const CollectionPlan& plan) {
  std::vector<std::int64_t> sizes;
  for (const Collected& gone : plan.remove) sizes.push_back(gone.file.size);
  return sizes;
}

/// Sizes tell the files apart.
const std::vector<StoredFile> kFiles = {File("a", 1, absl::Hours(1)), File("b", 20, absl::Hours(300)), File("c", 300, absl::Hours(200)),
                                        File("d", 4000, absl::Hours(100)), File("e", 50'000, absl::Hours(400), StoredFile::What::kBlob)};

TEST(CollectionPolicy, WithoutAPolicyAllStays) {
  EXPECT_FALSE(CollectionPolicy().asked_for());
  EXPECT_THAT(Sizes(PlanCollection(kFiles, {}, {}, kNow)), IsEmpty());
}

TEST(CollectionPolicy, WhatNobodyUsedForLongGoesOldestFirst) {
  const CollectionPlan plan = PlanCollection(kFiles, {}, {.keep = absl::Hours(200)}, kNow);
  EXPECT_THAT(Sizes(plan), ElementsAre(50'000, 20, 300));
  EXPECT_EQ(plan.bytes, 50'320);
  EXPECT_EQ(plan.bytes_before, 54'321);
  for (const Collected& gone : plan.remove) EXPECT_EQ(gone.why, Collected::Why::kOld);
}

TEST(CollectionPolicy, NothingInUseGoes) {
  InUse in_use;
  in_use.results.insert(base::HashBytes("b"));
  in_use.blobs.insert(base::HashBytes("e"));
  const CollectionPlan plan =
      PlanCollection(kFiles, in_use, {.keep = absl::ZeroDuration(), .disk_limit = 1, .keep_at_least = absl::ZeroDuration()}, kNow);
  EXPECT_THAT(Sizes(plan), ElementsAre(300, 4000, 1));
  EXPECT_EQ(plan.bytes_in_use, 50'020);
  // A result's key says nothing about blobs.
  InUse other;
  other.results.insert(base::HashBytes("e"));
  EXPECT_THAT(Sizes(PlanCollection(kFiles, other, {.keep = absl::Hours(399)}, kNow)), ElementsAre(50'000));
}

TEST(CollectionPolicy, TheLimitTakesWhatWasUsedLongestAgoAndNoMoreThanNeeded) {
  EXPECT_THAT(Sizes(PlanCollection(kFiles, {}, {.disk_limit = 54'321}, kNow)), IsEmpty());
  EXPECT_THAT(Sizes(PlanCollection(kFiles, {}, {.disk_limit = 54'320}, kNow)), ElementsAre(50'000));
  EXPECT_THAT(Sizes(PlanCollection(kFiles, {}, {.disk_limit = 4301}, kNow)), ElementsAre(50'000, 20));
}

TEST(CollectionPolicy, TheYoungStayEvenAboveTheLimit) {
  EXPECT_THAT(Sizes(PlanCollection(kFiles, {}, {.disk_limit = 1, .keep_at_least = absl::Hours(150)}, kNow)), ElementsAre(50'000, 20, 300));
}

}  // namespace
}  // namespace vorocast::server
