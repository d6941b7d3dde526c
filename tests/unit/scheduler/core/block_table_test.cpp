// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/core/block_table.h"

#include <gtest/gtest.h>

#include <memory>

namespace vorocast::core {
namespace {

TEST(BlockTable, KeepsItsElementsWhereTheyAreAndGivesForgottenBlocksBack) {
  BlockTable<std::shared_ptr<int>> table;
  const auto value = std::make_shared<int>(7);
  table.push_back(value);
  const auto* first = &table[0];
  for (int i = 1; i < 3000; ++i) table.push_back(value);
  EXPECT_EQ(first, &table[0]);
  EXPECT_EQ(table.size(), 3000u);
  EXPECT_EQ(value.use_count(), 3001);
  for (std::size_t i = 0; i < 2500; ++i) table.Forget(i);
  EXPECT_EQ(value.use_count(), 501);
  EXPECT_FALSE(table.HasBlock(0));
  EXPECT_FALSE(table.HasBlock(2047));
  EXPECT_TRUE(table.HasBlock(2048));
  EXPECT_EQ(table[2048], nullptr);
  EXPECT_EQ(*table[2999], 7);
  for (std::size_t i = 2500; i < 3000; ++i) table.Forget(i);
  table.push_back(value);
  EXPECT_EQ(*table[3000], 7);
}

}  // namespace
}  // namespace vorocast::core
