// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/report/session_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <regex>
#include <set>
#include <vector>

#include <fmt/format.h>

#include "services/report/frame_picture.h"
#include "services/report/html.h"

namespace vorocast::report {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr double kNow = 1'800'000'000;

v1::TaskAttempt Attempt(const std::string& task, const std::string& kind, const std::string& worker, double begin, double seconds,
                        v1::State outcome) {
  v1::TaskAttempt attempt;
  attempt.set_task(task);
  attempt.set_kind(kind);
  attempt.set_worker(worker);
  attempt.set_started(kNow + begin);
  attempt.set_ended(kNow + begin + seconds);
  attempt.set_outcome(outcome);
  return attempt;
}

/// Every element that is opened is closed, in order: what a text that got out of its place would break.
bool IsWellFormed(const std::string& html) {
  static const std::regex kTag("<(/?)([a-z0-9]+)((\"[^\"]*\"|[^>\"])*)>");
  const std::set<std::string> empty = {"meta", "br", "img"};
  std::vector<std::string> open;
  // The style has no tags; the doctype begins with "<!".
  for (std::sregex_iterator tag(html.begin(), html.end(), kTag), end; tag != end; ++tag) {
    const std::string name = (*tag)[2];
    const std::string rest = (*tag)[3];
    if (empty.contains(name) || rest.ends_with("/")) continue;
    if ((*tag)[1].length() == 0) {
      open.push_back(name);
    } else {
      if (open.empty() || open.back() != name) return false;
      open.pop_back();
    }
  }
  return open.empty();
}

SessionReport Hostile() {
  const std::string text = "</p></td><script>alert('x')</script>\"><img src=x onerror=\"y\">&\x01";
  SessionReport report{.session = text, .scheduler = text, .version = text, .made = kNow};
  report.fleet.set_description(text);
  JobReport& shown = report.jobs.emplace_back();
  shown.job.set_id("j1" + text);
  shown.job.set_sequence_name(text);
  shown.job.set_user(text);
  shown.job.set_onto_sequence_name(text);
  shown.job.set_state(v1::FAILED);
  shown.attempts_missing = text;
  for (const std::string& label : {text, std::string("frame 3: tessellate")}) {
    v1::FailedTask& failure = *shown.job.add_failures();
    failure.set_label(label);
    failure.set_cause(text);
  }
  shown.job.add_stages()->set_kind(text);
  shown.pictures.push_back({.task = "frame 3: tessellate", .why_not = text});
  shown.pictures.push_back({.task = text, .png = "bytes"});
  v1::TaskAttempt attempt = Attempt(text, text, text, 0, 1, v1::FAILED);
  attempt.set_cause(text);
  attempt.set_log(text);
  shown.attempts.Add(attempt);
  report.timeline.Add(attempt, kNow);
  attempt.set_outcome(v1::DONE);
  shown.attempts.Add(attempt);
  return report;
}

TEST(SessionReport, TextFromElsewhereStaysText) {
  const std::string html = ToHtml(Hostile());
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("<img src=x")));
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;"));
  EXPECT_EQ(html.find('\x01'), std::string::npos);
  EXPECT_TRUE(IsWellFormed(html));
  EXPECT_EQ(Escape("a<b>&\"c'\x1b\n"), "a&lt;b&gt;&amp;&quot;c&#39;\n");
}

TEST(SessionReport, NeedsNothingFromOutside) {
  const std::string html = ToHtml(Hostile());
  for (const char* outside : {"http:", "https:", "<link", "@import", "url("}) EXPECT_THAT(html, Not(HasSubstr(outside)));
}

TEST(SessionReport, SaysWhatFinishedWhatFailedAndWhy) {
  SessionReport report{.session = "monday", .version = "1", .made = kNow};
  JobReport& shown = report.jobs.emplace_back();
  shown.job.set_id("j7");
  shown.job.set_state(v1::DONE);
  shown.job.set_submitted(kNow - 100);
  shown.job.set_ended(kNow - 25);
  v1::FailedTask& failure = *shown.job.add_failures();
  failure.set_label("frame 12: tessellate");
  failure.set_cause("bad input: no points");
  v1::Stage& stage = *shown.job.add_stages();
  stage.set_kind("tessellate");
  stage.set_total(5);
  stage.set_done(4);
  stage.set_failed(1);
  for (int i = 0; i < 4; ++i) shown.attempts.Add(Attempt(fmt::format("frame {}: tessellate", i), "tessellate", "w", i, 1.5 + i, v1::DONE));
  shown.attempts.Add(Attempt("frame 12: tessellate", "tessellate", "w", 9, 0.5, v1::FAILED));
  shown.pictures.push_back({.task = "frame 12: tessellate", .why_not = "the file is cut off"});
  const std::string html = ToHtml(report);
  EXPECT_TRUE(IsWellFormed(html));
  EXPECT_THAT(html, HasSubstr("<b>1 of 1 jobs done</b>"));
  EXPECT_THAT(html, HasSubstr("1:15 min"));  // from 100 to 25 seconds before
  EXPECT_THAT(html, HasSubstr("bad input: no points"));
  EXPECT_THAT(html, HasSubstr("No picture: the file is cut off"));
  EXPECT_THAT(html, HasSubstr("1 bad frame; the poses there were interpolated."));
  EXPECT_THAT(html, HasSubstr("4 of 5"));
  EXPECT_THAT(html, HasSubstr(">12.5 s<"));  // 1.5 + 2.5 + 3.5 + 4.5 + 0.5
}

TEST(Timeline, ShowsWhoDidWhatWhen) {
  Timeline timeline;
  timeline.Add(Attempt("a", "tessellate", "w1", 0, 40, v1::DONE), kNow);
  timeline.Add(Attempt("b", "track", "w2", 40, 40, v1::FAILED), kNow);
  EXPECT_EQ(timeline.begin(), kNow);
  EXPECT_EQ(timeline.end(), kNow + 80);
  const std::string svg = timeline.Svg();
  // Eight hundred columns: each attempt takes half of them.
  EXPECT_THAT(svg, HasSubstr(fmt::format("<path fill=\"{}\" d=\"M190 1h401v11h-401z\"/>", KindColour("tessellate"))));
  EXPECT_THAT(svg, HasSubstr(fmt::format("<path fill=\"{}\" d=\"M590 15h400v11h-400z\"/>", KindColour("track"))));
  EXPECT_EQ(std::count(svg.begin(), svg.end(), '\n'), 2);  // a line a worker
  EXPECT_THAT(svg, HasSubstr("stroke=\"#d00000\""));
}

TEST(Timeline, TenThousandsOfAttemptsStaySmall) {
  SessionReport report{.session = "night", .made = kNow};
  JobReport& shown = report.jobs.emplace_back();
  const char* const kinds[] = {"tessellate", "track", "simulate", "sheet"};
  for (int i = 0; i < 100'000; ++i) {
    v1::TaskAttempt attempt = Attempt(fmt::format("frame {}: tessellate", i), kinds[i % 4], fmt::format("slurm-{}", i % 1500), i * 0.3, 0.01 + i % 97,
                                      i % 5 ? v1::DONE : v1::FAILED);
    attempt.set_log(std::string(60'000, 'x'));
    shown.attempts.Add(attempt);
    report.timeline.Add(attempt, kNow);
  }
  const std::string html = ToHtml(report);
  EXPECT_LT(html.size(), std::size_t{5} << 20);
  EXPECT_THAT(html, HasSubstr("20000 of 100000 attempts failed"));
  EXPECT_TRUE(shown.attempts.Slowest().size() == 10 && shown.attempts.Slowest().front().seconds > 96);
}

TEST(DrawFrame, DrawsEvenWhatThePipelineRefuses) {
  // A ball in millimetres whose normals all point inward, with a point that is no number.
  std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 3001\nproperty float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\nend_header\nnan 0 0 0 0 1\n";
  for (int i = 0; i < 3000; ++i) {
    const double z = 1 - 2 * (i + 0.5) / 3000;
    const double r = std::sqrt(1 - z * z);
    const double x = r * std::cos(2.39996 * i);
    const double y = r * std::sin(2.39996 * i);
    ply += fmt::format("{} {} {} {} {} {}\n", 900 * x, 900 * y, 900 * z, -x, -y, -z);
  }
  const auto png = DrawFrame(ply, ".ply");
  ASSERT_TRUE(png.ok()) << png.status();
  EXPECT_EQ(png->substr(1, 3), "PNG");
  EXPECT_GT(png->size(), 2000u);
}

TEST(DrawFrame, SaysWhyThereIsNoPicture) {
  const auto cut = DrawFrame("ply\nformat ascii 1.0\nelement ver", ".ply");
  EXPECT_FALSE(cut.ok());
  EXPECT_THAT(std::string(cut.status().message()), Not(HasSubstr("/tmp")));
  EXPECT_FALSE(DrawFrame("", ".obj").ok());
}

}  // namespace
}  // namespace vorocast::report
