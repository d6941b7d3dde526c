// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/look_up_thread.h"

#include <algorithm>
#include <filesystem>

#include <spdlog/spdlog.h>

#include "absl/time/clock.h"
#include "services/storage/collection.h"

namespace vorocast::server {
namespace {

constexpr std::size_t kAnswersAtOnce = 256;

/// A damaged file is moved aside, where whoever looks for the cause finds it, so that the result can be made again under its name.
bool IsDamaged(const std::filesystem::path& path, const core::Result& result, bool verify) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (error) return true;
  bool damaged = static_cast<std::int64_t>(size) != result.size;
  if (!damaged && verify) {
    const auto sha256 = base::HashFile(path);
    damaged = !sha256.ok() || *sha256 != result.sha256;
  }
  if (!damaged) return false;
  spdlog::error("a result is damaged and will be made again: file={}", path.string());
  std::filesystem::rename(path, path.string() + ".damaged", error);
  return true;
}

}  // namespace

LookUpThread::LookUpThread(store::Store& store, const storage::ArtifactStore& artifacts, Answers answers)
    : store_(store), artifacts_(artifacts), answers_(std::move(answers)), thread_([this] { Run(); }) {}

LookUpThread::~LookUpThread() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void LookUpThread::Ask(std::vector<core::LookUp> look_ups) {
  {
    const std::lock_guard lock(mutex_);
    std::move(look_ups.begin(), look_ups.end(), std::back_inserter(asked_));
  }
  wake_.notify_one();
}

void LookUpThread::Run() {
  while (true) {
    std::vector<core::LookUp> batch;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [this] { return stopping_ || !asked_.empty(); });
      if (stopping_) return;
      const std::size_t count = std::min(kAnswersAtOnce, asked_.size());
      std::move(asked_.begin(), asked_.begin() + static_cast<std::ptrdiff_t>(count), std::back_inserter(batch));
      asked_.erase(asked_.begin(), asked_.begin() + static_cast<std::ptrdiff_t>(count));
    }
    std::vector<core::LookUpAnswered> answers;
    for (const core::LookUp& look_up : batch) answers.push_back(Answer(look_up));
    answers_(std::move(answers));
  }
}

core::LookUpAnswered LookUpThread::Answer(const core::LookUp& look_up) const {
  core::LookUpAnswered answer{.key = look_up.key};
  const std::filesystem::path path = artifacts_.ArtifactPath(look_up.key, look_up.extension);
  storage::NoteUse(path, absl::Now());
  if (!artifacts_.HasArtifact(look_up.key, look_up.extension)) return answer;
  auto on_record = store_.FindResult(look_up.key);
  if (!on_record.ok()) spdlog::error("look-up failed: key={} error=\"{}\"", look_up.key.Hex(), std::string(on_record.status().message()));
  if (on_record.ok() && *on_record) {
    if (IsDamaged(path, **on_record, look_up.verify)) return answer;
    answer.result = std::move(**on_record);
    answer.recorded = true;
    return answer;
  }
  const auto sha256 = base::HashFile(path);
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (sha256.ok() && !error) answer.result = core::Result{.sha256 = *sha256, .size = static_cast<std::int64_t>(size)};
  return answer;
}

}  // namespace vorocast::server
