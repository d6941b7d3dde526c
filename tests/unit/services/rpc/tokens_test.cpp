// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rpc/tokens.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vorocast::rpc {
namespace {

Roles RolesOf(std::initializer_list<Role> list) {
  Roles roles;
  for (const Role role : list) roles.Add(role);
  return roles;
}

TEST(Roles, ImplyWhatTheyShould) {
  EXPECT_EQ(RolesOf({Role::kOperate}), RolesOf({Role::kOperate, Role::kSubmit, Role::kRead}));
  EXPECT_EQ(RolesOf({Role::kSubmit}), RolesOf({Role::kSubmit, Role::kRead}));
  EXPECT_FALSE(RolesOf({Role::kSubmit}).Has(Role::kOperate));
  EXPECT_FALSE(RolesOf({Role::kRead}).Has(Role::kSubmit));
  EXPECT_FALSE(RolesOf({Role::kWork}).Has(Role::kRead));
  EXPECT_FALSE(RolesOf({Role::kOperate}).Has(Role::kWork));
}

TEST(Roles, AreReadFromNames) {
  EXPECT_EQ(*RolesFromNames("submit,work"), RolesOf({Role::kSubmit, Role::kWork}));
  for (const char* wrong : {"", "admin", "submit,", ",work", "Submit", "submit work"}) EXPECT_FALSE(RolesFromNames(wrong).ok()) << wrong;
}

TEST(Tokens, AMadeOneIsFoundByItsLine) {
  const auto stage = MakeToken("stage", RolesOf({Role::kSubmit}));
  const auto farm = MakeToken("farm-7", RolesOf({Role::kWork}));
  ASSERT_TRUE(stage.ok() && farm.ok());
  EXPECT_NE(stage->token, farm->token);
  EXPECT_EQ(stage->line.find(stage->token), std::string::npos) << "the file must not hold the token";
  const auto entries = ParseTokens("# who may\n\n" + stage->line + "\r\n  " + farm->line);
  ASSERT_TRUE(entries.ok()) << entries.status();
  ASSERT_EQ(entries->size(), 2u);
  ASSERT_NE(FindToken(*entries, farm->token), nullptr);
  EXPECT_EQ(FindToken(*entries, farm->token)->name, "farm-7");
  EXPECT_EQ(FindToken(*entries, stage->token)->roles, RolesOf({Role::kSubmit}));
  EXPECT_EQ(FindToken(*entries, stage->token + "x"), nullptr);
  EXPECT_EQ(FindToken(*entries, ""), nullptr);
}

TEST(Tokens, TheDigestIsOfTheTokenAlone) {
  // What `printf abc | sha256sum` prints.
  const auto entries = ParseTokens("a read ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  ASSERT_TRUE(entries.ok());
  EXPECT_NE(FindToken(*entries, "abc"), nullptr);
}

TEST(Tokens, AWrongLineIsNamed) {
  const std::string digest(64, 'a');
  for (const std::string& wrong : {std::string("stage submit"), "stage submit " + digest + " more", "stage boss " + digest,
                                   "stage submit " + digest.substr(1), "st/age submit " + digest, std::string(65, 'x') + " submit " + digest}) {
    const auto entries = ParseTokens("good read " + digest + "\n" + wrong);
    ASSERT_FALSE(entries.ok()) << wrong;
    EXPECT_THAT(std::string(entries.status().message()), testing::StartsWith("line 2: ")) << wrong;
  }
}

TEST(Tokens, AreBoundedInNumber) {
  std::string text;
  for (std::size_t i = 0; i <= kTokenEntriesMax; ++i) text += "x read " + std::string(64, 'a') + "\n";
  EXPECT_FALSE(ParseTokens(text).ok());
}

}  // namespace
}  // namespace vorocast::rpc
