// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/artifact_store.h"

#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <set>
#include <sstream>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::storage {
namespace {

std::filesystem::path WriteTemporary(const ArtifactStore& store, const std::string& text) {
  const std::filesystem::path path = store.TemporaryPath(".h5");
  std::ofstream(path) << text;
  return path;
}

std::string Text(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

TEST(ArtifactStore, NamesFilesAsTheFormatSays) {
  const TemporaryFolder folder;
  const ArtifactStore store = ArtifactStore::Open(folder / "store").value();
  const base::Digest digest = base::HashBytes("abc");  // ba7816bf…
  EXPECT_EQ(store.BlobPath(digest, ".ply"), folder / "store" / "blobs" / "ba" / (digest.Hex() + ".ply"));
  EXPECT_EQ(store.ArtifactPath(digest, ".h5"), folder / "store" / "artifacts" / "ba" / (digest.Hex() + ".h5"));
}

TEST(ArtifactStore, PublishesOnceAndForAll) {
  const TemporaryFolder folder;
  const ArtifactStore store = ArtifactStore::Open(folder / "store").value();
  const base::Digest key = base::HashBytes("key");
  EXPECT_FALSE(store.HasArtifact(key, ".h5"));
  const auto first = WriteTemporary(store, "first");
  const auto second = WriteTemporary(store, "second");
  EXPECT_EQ(store.PublishArtifact(first, key, ".h5"), absl::OkStatus());
  EXPECT_TRUE(store.HasArtifact(key, ".h5"));
  EXPECT_FALSE(store.HasArtifact(key, ".png"));
  EXPECT_EQ(store.PublishArtifact(second, key, ".h5"), absl::OkStatus());
  EXPECT_EQ(Text(store.ArtifactPath(key, ".h5")), "first");
  EXPECT_TRUE(std::filesystem::is_empty(folder / "store" / "tmp"));
}

TEST(ArtifactStore, ManyMayPublishOneNameAtOnce) {
  const TemporaryFolder folder;
  const ArtifactStore store = ArtifactStore::Open(folder / "store").value();
  const base::Digest key = base::HashBytes("key");
  std::vector<absl::Status> statuses(8);
  {
    std::vector<std::jthread> threads;
    for (absl::Status& status : statuses) {
      threads.emplace_back([&] { status = store.PublishArtifact(WriteTemporary(store, "same"), key, ".h5"); });
    }
  }
  for (const absl::Status& status : statuses) EXPECT_EQ(status, absl::OkStatus());
  EXPECT_EQ(Text(store.ArtifactPath(key, ".h5")), "same");
}

TEST(ArtifactStore, RefusesABlobUnderAnotherName) {
  const TemporaryFolder folder;
  const ArtifactStore store = ArtifactStore::Open(folder / "store").value();
  const base::Digest digest = base::HashBytes("bytes");
  EXPECT_EQ(store.PublishBlob(WriteTemporary(store, "bites"), digest, ".ply").code(), absl::StatusCode::kDataLoss);
  EXPECT_FALSE(store.HasBlob(digest, ".ply"));
  EXPECT_EQ(store.PublishBlob(WriteTemporary(store, "bytes"), digest, ".ply"), absl::OkStatus());
  EXPECT_EQ(Text(store.BlobPath(digest, ".ply")), "bytes");
}

TEST(ArtifactStore, TemporaryNamesDiffer) {
  const TemporaryFolder folder;
  const ArtifactStore store = ArtifactStore::Open(folder / "store").value();
  std::set<std::filesystem::path> names;
  for (int i = 0; i < 100; ++i) names.insert(store.TemporaryPath(".h5"));
  EXPECT_EQ(names.size(), 100u);
}

TEST(ArtifactStore, AFileWhereTheFolderShouldBeIsAnError) {
  const TemporaryFolder folder;
  std::ofstream(folder / "store") << "in the way";
  EXPECT_EQ(ArtifactStore::Open(folder / "store").status().code(), absl::StatusCode::kUnavailable);
}

TEST(ArtifactStore, RemovesOnlyWhatTheDeadLeft) {
  const TemporaryFolder folder;
  const ArtifactStore store = ArtifactStore::Open(folder / "store").value();
  const auto of_the_living = WriteTemporary(store, "mine");
  // A process that has ended left a file under its own number.
  const pid_t child = ::fork();
  if (child == 0) {
    std::ofstream(store.TemporaryPath(".h5")) << "left";
    ::_exit(0);
  }
  ASSERT_EQ(::waitpid(child, nullptr, 0), child);
  EXPECT_EQ(store.RemoveStaleTemporaries(absl::Hours(1)), 0);
  EXPECT_EQ(store.RemoveStaleTemporaries(absl::ZeroDuration()), 1);
  EXPECT_TRUE(std::filesystem::exists(of_the_living));
}

}  // namespace
}  // namespace vorocast::storage
