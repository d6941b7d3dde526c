// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/tasks/task.h"

#include <functional>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include "services/tasks/options.h"

namespace vorocast::tasks {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

TaskSpec GuideSpec() {
  TaskSpec spec{Kind::kGuide, ToJson(GuideOptions()), {}};
  spec.inputs.push_back({"template", -1, Input::Source::kArtifact, ".h5", base::HashBytes("template")});
  spec.inputs.push_back({"cells", 0, Input::Source::kArtifact, ".h5", base::HashBytes("cells 0"), base::HashBytes("bytes of cells 0")});
  spec.inputs.push_back({"cells", 1, Input::Source::kArtifact, ".h5", std::nullopt});
  return spec;
}

TEST(Kind, NamesGoBothWays) {
  std::set<std::string_view> names;
  for (const Kind kind : kAllKinds) {
    EXPECT_EQ(KindFromName(Name(kind)).value(), kind);
    names.insert(Name(kind));
  }
  EXPECT_EQ(names.size(), std::size(kAllKinds));
  EXPECT_THAT(std::string(KindFromName("paint").status().message()), HasSubstr("tessellate"));
}

TEST(TaskSpec, GoesBothWaysWithItsKey) {
  const TaskSpec spec = GuideSpec();
  const absl::StatusOr<TaskSpec> read = TaskSpecFromJson(json::parse(ToJson(spec).dump()));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->Key(), spec.Key());
  EXPECT_EQ(ToJson(*read), ToJson(spec));
  EXPECT_FALSE(read->inputs[2].digest.has_value());
  EXPECT_EQ(read->inputs[1].content, base::HashBytes("bytes of cells 0"));
}

TEST(TaskSpec, KeyDoesNotDependOnWhatIsKnownOfTheInputsBytes) {
  TaskSpec spec = GuideSpec();
  spec.inputs[1].content.reset();
  EXPECT_EQ(spec.Key(), GuideSpec().Key());
}

TEST(TaskSpec, KeyDependsOnEverythingTheResultDependsOn) {
  const std::function<void(TaskSpec&)> changes[] = {
      [](TaskSpec& spec) { spec.kind = Kind::kTrack; },
      [](TaskSpec& spec) { spec.options["points"] = 6001; },
      [](TaskSpec& spec) { spec.inputs.pop_back(); },
      [](TaskSpec& spec) { std::swap(spec.inputs[0], spec.inputs[1]); },
      [](TaskSpec& spec) { spec.inputs[1].role = "window"; },
      [](TaskSpec& spec) { spec.inputs[1].frame = 7; },
      [](TaskSpec& spec) { spec.inputs[1].source = Input::Source::kBlob; },
      [](TaskSpec& spec) { spec.inputs[1].extension = ".ply"; },
      [](TaskSpec& spec) { spec.inputs[1].digest = base::HashBytes("other"); },
      [](TaskSpec& spec) { spec.inputs[1].digest.reset(); },
  };
  std::set<std::string> keys = {GuideSpec().Key().Hex()};
  for (const auto& change : changes) {
    TaskSpec spec = GuideSpec();
    change(spec);
    keys.insert(spec.Key().Hex());
  }
  EXPECT_EQ(keys.size(), 1 + std::size(changes));
}

TEST(TaskSpec, KeyDoesNotDependOnTheOrderInWhichOptionsWereWritten) {
  TaskSpec one = GuideSpec();
  TaskSpec other = GuideSpec();
  one.options = json::parse(R"({"points": 5, "iterations": 6})");
  other.options = json::parse(R"({"iterations": 6, "points": 5})");
  EXPECT_EQ(one.Key(), other.Key());
}

/// The message with which a changed spec is refused, or "accepted".
std::string Refusal(const std::function<void(json&)>& change) {
  json value = ToJson(GuideSpec());
  change(value);
  const absl::StatusOr<TaskSpec> read = TaskSpecFromJson(value);
  if (read.ok()) return "accepted";
  EXPECT_EQ(read.status().code(), absl::StatusCode::kInvalidArgument);
  return std::string(read.status().message());
}

TEST(TaskSpec, WhatComesOverAWireIsNotBelieved) {
  EXPECT_EQ(Refusal([](json&) {}), "accepted");
  EXPECT_THAT(Refusal([](json& value) { value = "task"; }), HasSubstr("task"));
  EXPECT_THAT(Refusal([](json& value) { value["more"] = 1; }), HasSubstr("unknown field"));
  EXPECT_THAT(Refusal([](json& value) { value.erase("inputs"); }), HasSubstr("task.inputs"));
  EXPECT_THAT(Refusal([](json& value) { value["kind"] = "paint"; }), HasSubstr("kinds are"));
  EXPECT_THAT(Refusal([](json& value) { value["kind"] = 3; }), HasSubstr("kind"));
  EXPECT_THAT(Refusal([](json& value) { value["options"]["points"] = -4; }), HasSubstr("options.points"));
  EXPECT_THAT(Refusal([](json& value) { value["inputs"] = json::object(); }), HasSubstr("inputs"));
  EXPECT_THAT(Refusal([](json& value) { value["inputs"][1] = 4; }), HasSubstr("inputs[1]"));
  EXPECT_THAT(Refusal([](json& value) { value["inputs"][1]["role"] = "friend"; }), HasSubstr("inputs[1].role"));
  EXPECT_THAT(Refusal([](json& value) { value["inputs"][1]["frame"] = -2; }), HasSubstr("inputs[1].frame"));
  EXPECT_THAT(Refusal([](json& value) { value["inputs"][1]["frame"] = 1.5; }), HasSubstr("inputs[1].frame"));
  EXPECT_THAT(Refusal([](json& value) { value["inputs"][1]["frame"] = 18446744073709551615ULL; }), HasSubstr("inputs[1].frame"));
  EXPECT_THAT(Refusal([](json& value) { value["inputs"][1]["source"] = "web"; }), HasSubstr("inputs[1].source"));
  EXPECT_THAT(Refusal([](json& value) { value["inputs"][1]["extension"] = "/../x"; }), HasSubstr("inputs[1].extension"));
  EXPECT_THAT(Refusal([](json& value) { value["inputs"][1]["digest"] = "../../etc/passwd"; }), HasSubstr("inputs[1].digest"));
  EXPECT_THAT(Refusal([](json& value) { value["inputs"][1]["content"] = "abc"; }), HasSubstr("inputs[1].content"));
  EXPECT_THAT(Refusal([](json& value) { value["inputs"][1].erase("digest"); }), HasSubstr("inputs[1].digest"));
  EXPECT_THAT(Refusal([](json& value) { value["inputs"] = std::vector<int>(40001, 1); }), HasSubstr("at most 40000"));
}

}  // namespace
}  // namespace vorocast::tasks
