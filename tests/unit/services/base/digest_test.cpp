// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/base/digest.h"

#include <gtest/gtest.h>

namespace vorocast::base {
namespace {

TEST(Digest, MatchesTheStandardsTestVectors) {  // FIPS 180-4
  EXPECT_EQ(HashBytes("abc").Hex(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(HashBytes("").Hex(), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(Digest, HexGoesBothWays) {
  const Digest digest = HashBytes("vorocast");
  EXPECT_EQ(Digest::FromHex(digest.Hex()).value(), digest);
}

TEST(Digest, RefusesWhatIsNotADigest) {
  EXPECT_FALSE(Digest::FromHex("../../etc/passwd").ok());
  EXPECT_FALSE(Digest::FromHex(std::string(64, 'g')).ok());
  EXPECT_FALSE(Digest::FromHex(std::string(63, 'a')).ok());
  EXPECT_FALSE(Digest::FromHex(std::string(64, 'A')).ok());
}

TEST(Hasher, FieldsDoNotRunTogether) {
  EXPECT_NE(Hasher().UpdateField("ab").UpdateField("c").Finish(), Hasher().UpdateField("a").UpdateField("bc").Finish());
}

}  // namespace
}  // namespace vorocast::base
