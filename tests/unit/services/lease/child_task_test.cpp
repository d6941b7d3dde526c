// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/child_task.h"

#include <gtest/gtest.h>
#include "services/tasks/options.h"

namespace vorocast::lease {
namespace {

TEST(ChildTask, GoesBothWays) {
  const ChildTask task{{tasks::Kind::kGuide, ToJson(tasks::GuideOptions()), {}}, "/store", "/store/tmp/x.h5", 1 << 30, 42};
  const absl::StatusOr<ChildTask> read = DecodeChildTask(Encode(task));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->spec.Key(), task.spec.Key());
  EXPECT_EQ(read->store_root, task.store_root);
  EXPECT_EQ(read->output, task.output);
  EXPECT_EQ(read->memory_limit, task.memory_limit);
  EXPECT_EQ(read->worker_pid, task.worker_pid);
}

TEST(ChildTask, RefusesWhatIsCutOff) {
  const std::string whole = Encode({{tasks::Kind::kGuide, ToJson(tasks::GuideOptions()), {}}, "/store", "/out", 1, 42});
  for (std::size_t length = 0; length < whole.size(); ++length) EXPECT_FALSE(DecodeChildTask(whole.substr(0, length)).ok());
}

TEST(ChildLine, KnowsProgressAndOutcome) {
  EXPECT_EQ(DecodeChildLine(EncodeProgress(0.25)).progress, 0.25);
  const absl::Status status = absl::DataLossError("line one\nline two \xff");
  const ChildLine line = DecodeChildLine(EncodeOutcome(status));
  ASSERT_TRUE(line.outcome.has_value());
  EXPECT_EQ(line.outcome->code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(std::string(line.outcome->message()), "line one\nline two \xEF\xBF\xBD");
  EXPECT_EQ(EncodeOutcome(status).find('\n'), std::string::npos);
}

TEST(ChildLine, PassesOverEverythingElse) {
  for (const char* text : {"", "warning: something", "{}", "[1]", "{\"code\": \"x\"}", "{\"progress\": \"half\"}", "{\"code\": 1}"}) {
    const ChildLine line = DecodeChildLine(text);
    EXPECT_FALSE(line.progress || line.outcome) << text;
  }
}

TEST(TextForPeople, IsCutBetweenCharacters) {
  EXPECT_EQ(TextForPeople("short", 10), "short");
  EXPECT_EQ(TextForPeople("äöüäöü", 8), "äö…");  // two bytes a letter, three for the ellipsis
  EXPECT_EQ(TailForPeople("äöüäöü\n\n", 8), "…öü");
  EXPECT_EQ(TailForPeople(" last \n", 10), " last");
}

}  // namespace
}  // namespace vorocast::lease
