// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/input_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>
#include <filesystem>

#include <fstream>
#include <memory>

#include "services/base/digest.h"

namespace vorocast::lease {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

class InputCheckTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::temp_directory_path() / fs::path("vorocast-input-check-" + std::to_string(getpid()));
    auto store = storage::ArtifactStore::Open(root_);
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = std::make_unique<storage::ArtifactStore>(*store);
  }
  void TearDown() override { fs::remove_all(root_); }

  /// A result of these bytes under some key, and the input that names it.
  tasks::Input Result(const std::string& bytes, const std::string& key) {
    const fs::path temporary = store_->TemporaryPath(".h5");
    std::ofstream(temporary, std::ios::binary) << bytes;
    const base::Digest digest = *base::HashFile(temporary);
    const base::Digest name = base::Hasher().UpdateField(key).Finish();
    EXPECT_TRUE(store_->PublishArtifact(temporary, name, ".h5").ok());
    return {.role = "cells", .extension = ".h5", .digest = name, .content = digest};
  }
  tasks::Input Frame(const std::string& bytes) {
    const fs::path temporary = store_->TemporaryPath(".ply");
    std::ofstream(temporary, std::ios::binary) << bytes;
    const base::Digest digest = *base::HashFile(temporary);
    EXPECT_TRUE(store_->PublishBlob(temporary, digest, ".ply").ok());
    return {.role = "frame", .source = tasks::Input::Source::kBlob, .extension = ".ply", .digest = digest};
  }
  void Flip(const fs::path& path) const {
    fs::permissions(path, fs::perms::owner_all);
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
    const char byte = static_cast<char>(file.get() ^ 1);
    file.seekp(0).put(byte);
  }
  absl::Status Check(const std::vector<tasks::Input>& inputs) { return check_.Check({.inputs = inputs}, *store_); }

  fs::path root_;
  std::unique_ptr<storage::ArtifactStore> store_;
  InputCheck check_;
};

TEST_F(InputCheckTest, WhatIsAsItWasMadeIsFine) {
  const std::vector<tasks::Input> inputs = {Result("some cells", "a"), Frame("a frame"), {.role = "cells"}};
  EXPECT_TRUE(Check(inputs).ok());
  EXPECT_TRUE(Check(inputs).ok());
}

TEST_F(InputCheckTest, AFlippedBitIsSeenAlsoInAFileThatWasRightBefore) {
  const tasks::Input cells = Result("some cells", "a");
  ASSERT_TRUE(Check({cells}).ok());
  Flip(store_->ArtifactPath(*cells.digest, ".h5"));
  const absl::Status status = Check({cells});
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr(cells.digest->Hex()), HasSubstr("vorocast retry")));
}

TEST_F(InputCheckTest, ADamagedFrameIsToBeSentAgain) {
  const tasks::Input frame = Frame("a frame");
  fs::permissions(store_->BlobPath(*frame.digest, ".ply"), fs::perms::owner_all);
  fs::resize_file(store_->BlobPath(*frame.digest, ".ply"), 3);
  const absl::Status status = Check({frame});
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(status.message()), HasSubstr("send the take again"));
}

TEST_F(InputCheckTest, ADamagedCopyIsRemoved) {
  const tasks::Input cells = Result("some cells", "a");
  const tasks::Input other = Result("other cells", "b");
  Flip(store_->ArtifactPath(*cells.digest, ".h5"));
  EXPECT_EQ(check_.Check({.inputs = {other, cells}}, *store_, InputCheck::Files::kCopies).code(), absl::StatusCode::kDataLoss);
  EXPECT_FALSE(store_->HasArtifact(*cells.digest, ".h5"));
  EXPECT_TRUE(store_->HasArtifact(*other.digest, ".h5"));
}

TEST_F(InputCheckTest, WhatIsNotThereIsNotFound) {
  const tasks::Input cells = Result("some cells", "a");
  fs::remove(store_->ArtifactPath(*cells.digest, ".h5"));
  EXPECT_EQ(Check({cells}).code(), absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace vorocast::lease
