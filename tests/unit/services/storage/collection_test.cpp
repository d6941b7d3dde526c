// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/collection.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <fstream>

#include "absl/time/clock.h"

#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::storage {
namespace {

namespace fs = std::filesystem;

class CollectionTest : public testing::Test {
 protected:
  fs::path Publish(const std::string& name, bool blob) {
    const fs::path temporary = store_.TemporaryPath(".h5");
    std::ofstream(temporary) << name;
    const base::Digest digest = base::HashBytes(name);
    EXPECT_TRUE((blob ? store_.PublishBlob(temporary, digest, ".ply") : store_.PublishArtifact(temporary, digest, ".h5")).ok());
    return blob ? store_.BlobPath(digest, ".ply") : store_.ArtifactPath(digest, ".h5");
  }
  std::vector<StoredFile> List() {
    auto files = ListStored(store_, [] { return false; });
    EXPECT_TRUE(files.ok()) << files.status();
    std::sort(files->begin(), files->end(), [](const StoredFile& a, const StoredFile& b) { return a.size < b.size; });
    return *files;
  }

  TemporaryFolder folder_;
  ArtifactStore store_ = ArtifactStore::Open(folder_.path()).value();
};

TEST_F(CollectionTest, ListsFramesAndResultsAndNothingElse) {
  Publish("a", true);
  Publish("bb", false);
  std::ofstream(folder_.path() / "artifacts" / "notes.txt") << "mine";
  std::ofstream(folder_.path() / "artifacts" / (base::HashBytes("c").Hex().substr(1) + ".h5")) << "too short a name";
  std::ofstream(store_.TemporaryPath(".h5")) << "being written";
  const auto files = List();
  ASSERT_EQ(files.size(), 2u);
  EXPECT_EQ(files[0].what, StoredFile::What::kBlob);
  EXPECT_EQ(files[0].digest, base::HashBytes("a"));
  EXPECT_EQ(files[0].extension, ".ply");
  EXPECT_EQ(files[0].size, 1);
  EXPECT_LT(absl::AbsDuration(files[0].used - absl::Now()), absl::Minutes(1));
  EXPECT_EQ(files[1].what, StoredFile::What::kResult);
}

TEST_F(CollectionTest, AFileThatHasBeenUsedSinceStays) {
  const fs::path path = Publish("a", false);
  const auto listed = List();
  const absl::Time later = listed[0].used + absl::Hours(3);
  NoteUse(path, later);
  EXPECT_EQ(List()[0].used, later);
  EXPECT_FALSE(*Discard(store_, listed[0]));
  EXPECT_TRUE(fs::exists(path));
  EXPECT_TRUE(*Discard(store_, List()[0]));
  EXPECT_FALSE(fs::exists(path));
  EXPECT_FALSE(*Discard(store_, listed[0]));
  NoteUse(path, later);
  EXPECT_FALSE(fs::exists(path));
  EXPECT_TRUE(List().empty());
  // And it can be made again.
  Publish("a", false);
  EXPECT_TRUE(fs::exists(path));
}

TEST_F(CollectionTest, ARemovalThatWasInterruptedIsFinished) {
  const fs::path path = Publish("a", false);
  fs::create_directories(folder_.path() / "trash");
  fs::rename(path, folder_.path() / "trash" / path.filename());  // as a crash between the two steps leaves it
  EXPECT_FALSE(store_.HasArtifact(base::HashBytes("a"), ".h5"));
  EmptyTrash(store_);
  EXPECT_TRUE(fs::is_empty(folder_.path() / "trash"));
}

}  // namespace
}  // namespace vorocast::storage
