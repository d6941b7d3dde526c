// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/report/session_report.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "absl/strings/escaping.h"
#include "absl/time/time.h"
#include "services/report/html.h"
#include "services/tasks/task.h"

namespace vorocast::report {
namespace {

constexpr const char* kStyle = R"(
body{font:14px/1.45 system-ui,sans-serif;color:#222;background:#fafafa;margin:2em auto;max-width:1060px;padding:0 1em}
h1{font-size:1.7em;margin:0 0 .2em}h2{font-size:1.25em;margin:2em 0 .4em;border-bottom:2px solid #ddd}h3{font-size:1em;margin:1.2em 0 .3em}
table{border-collapse:collapse;margin:.4em 0}td,th{padding:.2em .8em .2em 0;text-align:left;vertical-align:top}th{color:#666;font-weight:600}
td.n,th.n{text-align:right}.state{padding:0 .5em;border-radius:.6em;color:#fff;white-space:nowrap}
.done{background:#2a7d3f}.failed{background:#c22}.cancelled{background:#888}.running{background:#2566a8}
.note{color:#666}.bar{height:.9em;border-radius:2px}.barbox{width:300px}
figure{display:inline-block;margin:0 1em 1em 0;width:300px;vertical-align:top}figure img{width:300px;border:1px solid #ddd;background:#fff}
figcaption{font-size:.9em}.none{display:flex;height:180px;border:1px dashed #bbb;align-items:center;justify-content:center;text-align:center;color:#666;padding:0 1em;box-sizing:border-box}
pre{background:#f0f0f0;padding:.5em;overflow-x:auto;font-size:.85em;white-space:pre-wrap;word-break:break-word}
.timeline{max-width:100%;height:auto}.timeline text{font:10px system-ui,sans-serif;fill:#444}.key span{display:inline-block;margin-right:1.2em}
.key i{display:inline-block;width:.8em;height:.8em;margin-right:.3em;border-radius:2px}details{margin:.4em 0}summary{cursor:pointer}
)";

std::string When(double unix_seconds) {
  if (!(unix_seconds > 0)) return "–";
  return absl::FormatTime("%Y-%m-%d %H:%M:%S", absl::UnixEpoch() + absl::Seconds(unix_seconds), absl::LocalTimeZone());
}

std::string Lasted(double seconds) {
  if (!(seconds >= 0)) return "–";
  if (seconds < 60) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<long long>(std::llround(seconds));
  if (whole >= 3600) return fmt::format("{}:{:02}:{:02} h", whole / 3600, whole / 60 % 60, whole % 60);
  return fmt::format("{}:{:02} min", whole / 60, whole % 60);
}

std::string MiB(std::int64_t bytes) { return bytes > 0 ? fmt::format("{:.0f} MiB", static_cast<double>(bytes) / (1 << 20)) : "–"; }

std::string Badge(v1::State state) {
  switch (state) {
    case v1::DONE:
      return "<span class=\"state done\">done</span>";
    case v1::FAILED:
      return "<span class=\"state failed\">failed</span>";
    case v1::CANCELLED:
      return "<span class=\"state cancelled\">cancelled</span>";
    default:
      return "<span class=\"state running\">not ended</span>";
  }
}

bool IsFrame(const v1::FailedTask& failure) { return failure.label().starts_with("frame ") && failure.label().ends_with(": tessellate"); }

std::string ListJobs(const SessionReport& report) {
  std::string html =
      "<table><tr><th>job</th><th>take</th><th>by</th><th></th><th>submitted</th><th>took</th><th class=\"n\">tasks done</th><th "
      "class=\"n\">failed</th></tr>\n";
  for (const JobReport& shown : report.jobs) {
    const v1::Job& job = shown.job;
    std::int64_t done = 0;
    std::int64_t total = 0;
    std::int64_t failed = 0;
    for (const v1::Stage& stage : job.stages()) done += stage.done(), total += stage.total(), failed += stage.failed();
    const std::string took = job.submitted() > 0 && job.ended() > 0 ? Lasted(job.ended() - job.submitted()) : "–";
    html += fmt::format(
        "<tr><td><a href=\"#{0}\">{0}</a></td><td>{1}</td><td>{2}</td><td>{3}</td><td>{4}</td><td>{5}</td><td class=\"n\">{6} of {7}</td><td "
        "class=\"n\">{8}</td></tr>\n",
        Escape(job.id()), Escape(job.sequence_name()), Escape(job.user()), Badge(job.state()), When(job.submitted()), took, done, total, failed);
  }
  return html + "</table>\n";
}

std::string Figure(const FramePicture& picture, const std::string& cause) {
  const std::string image =
      picture.png.empty() ? fmt::format("<div class=\"none\">No picture: {}</div>", Escape(picture.why_not))
                          : fmt::format("<img alt=\"{}\" src=\"data:image/png;base64,{}\">", Escape(picture.task), absl::Base64Escape(picture.png));
  return fmt::format("<figure>{}<figcaption><b>{}</b><br>{}</figcaption></figure>\n", image, Escape(picture.task), Escape(cause));
}

/// Frames with their pictures, everything else as a list.
std::string Failures(const JobReport& shown) {
  const v1::Job& job = shown.job;
  if (job.failures().empty()) return {};
  const auto bad_frames = std::count_if(job.failures().begin(), job.failures().end(), IsFrame);
  std::string html = "<h3>What failed, and why</h3>\n";
  std::set<std::string> pictured;
  std::string figures;
  for (const FramePicture& picture : shown.pictures) {
    pictured.insert(picture.task);
    std::string cause;
    for (const v1::FailedTask& failure : job.failures()) {
      if (failure.label() == picture.task) cause = failure.cause();
    }
    figures += Figure(picture, cause);
  }
  if (bad_frames > 0) {
    html += fmt::format("<p>{} bad {}{}</p>\n", bad_frames, bad_frames == 1 ? "frame" : "frames",
                        job.state() == v1::DONE ? "; the poses there were interpolated." : ".");
  }
  html += figures;
  std::string rest;
  for (const v1::FailedTask& failure : job.failures()) {
    if (!pictured.contains(failure.label())) rest += fmt::format("<li><b>{}</b>: {}</li>\n", Escape(failure.label()), Escape(failure.cause()));
  }
  return rest.empty() ? html : html + "<ul>\n" + rest + "</ul>\n";
}

std::string Stages(const JobReport& shown) {
  double longest = 0;
  for (const auto& [name, kind] : shown.attempts.kinds()) longest = std::max(longest, kind.seconds);
  std::string html =
      "<h3>Time by stage</h3>\n<table><tr><th>stage</th><th class=\"n\">done</th><th class=\"n\">reused</th><th class=\"n\">failed</th><th "
      "class=\"n\">attempts</th><th class=\"n\">time</th><th class=\"n\">CPU</th><th class=\"n\">memory</th><th></th></tr>\n";
  for (const v1::Stage& stage : shown.job.stages()) {
    const auto found = shown.attempts.kinds().find(stage.kind());
    const AttemptTotals::Kind kind = found == shown.attempts.kinds().end() ? AttemptTotals::Kind{} : found->second;
    html += fmt::format(
        "<tr><td>{}</td><td class=\"n\">{} of {}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td "
        "class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"barbox\"><div class=\"bar\" style=\"width:{:.1f}%;background:{}\"></div></td></tr>\n",
        Escape(stage.kind()), stage.done(), stage.total(), stage.reused(), stage.failed(), kind.attempts, Lasted(kind.seconds),
        Lasted(kind.cpu_seconds), MiB(kind.memory_peak), longest > 0 ? 100 * kind.seconds / longest : 0, KindColour(stage.kind()));
  }
  html += "</table>\n";
  if (!shown.attempts_missing.empty())
    html += fmt::format("<p class=\"note\">The attempts could not be had: {}</p>\n", Escape(shown.attempts_missing));
  return html;
}

std::string Attempts(const JobReport& shown) {
  std::string html;
  const auto slowest = shown.attempts.Slowest();
  if (!slowest.empty()) {
    html +=
        fmt::format("<details><summary>Slowest tasks: {} took {}</summary>\n<table>", Escape(slowest.front().task), Lasted(slowest.front().seconds));
    for (const AttemptTotals::Slow& slow : slowest) {
      html += fmt::format("<tr><td>{}</td><td class=\"n\">{}</td><td>{}</td></tr>\n", Escape(slow.task), Lasted(slow.seconds), Escape(slow.worker));
    }
    html += "</table></details>\n";
  }
  if (shown.attempts.failed() == 0) return html;
  html += fmt::format("<details><summary>{} of {} attempts failed</summary>\n", shown.attempts.failed(), shown.attempts.attempts());
  for (const AttemptTotals::Failure& failure : shown.attempts.failures()) {
    html += fmt::format("<p><b>{}</b> on {} after {}: {}</p>\n", Escape(failure.task), Escape(failure.worker), Lasted(failure.seconds),
                        Escape(failure.cause));
    if (!failure.log_end.empty()) html += fmt::format("<pre>{}</pre>\n", Escape(failure.log_end));
  }
  if (static_cast<std::size_t>(shown.attempts.failed()) > shown.attempts.failures().size()) {
    html += fmt::format("<p class=\"note\">The first {} are shown; 'vorocast logs {} --failed' prints all.</p>\n", shown.attempts.failures().size(),
                        Escape(shown.job.id()));
  }
  return html + "</details>\n";
}

std::string Describe(const JobReport& shown) {
  const v1::Job& job = shown.job;
  std::string html =
      fmt::format("<h2 id=\"{0}\">{1} ({0}) {2}</h2>\n<p class=\"note\">", Escape(job.id()), Escape(job.sequence_name()), Badge(job.state()));
  html += fmt::format("By {}, submitted {}, ended {}.", Escape(job.user().empty() ? "nobody in particular" : job.user()), When(job.submitted()),
                      When(job.ended()));
  if (!job.onto_sequence_name().empty()) html += fmt::format(" Morphs into {}.", Escape(job.onto_sequence_name()));
  if (job.deadline() > 0) html += fmt::format(" Deadline {}{}.", When(job.deadline()), job.ended() > job.deadline() ? ", missed" : "");
  return html + "</p>\n" + Failures(shown) + Stages(shown) + Attempts(shown);
}

std::string DescribeTimeline(const Timeline& timeline) {
  if (timeline.empty()) return "<h2>Workers</h2>\n<p class=\"note\">No attempt is on record.</p>\n";
  std::string html =
      fmt::format("<h2>Workers</h2>\n<p class=\"note\">{} to {}; a row a worker, a red mark where an attempt failed.</p>\n<p class=\"key\">",
                  When(timeline.begin()), When(timeline.end()));
  for (const tasks::Kind kind : tasks::kAllKinds)
    html += fmt::format("<span><i style=\"background:{}\"></i>{}</span>", KindColour(tasks::Name(kind)), tasks::Name(kind));
  return html + "</p>\n" + timeline.Svg() + "\n";
}

std::string Versions(const SessionReport& report) {
  std::string kernels;
  for (const tasks::Kind kind : tasks::kAllKinds)
    kernels += fmt::format("{}{} {}", kernels.empty() ? "" : ", ", tasks::Name(kind), tasks::KernelVersion(kind));
  return fmt::format("<h2>Versions</h2>\n<p>vorocast {}; kernels: {}.</p>\n", Escape(report.version), kernels);
}

}  // namespace

std::string ToHtml(const SessionReport& report) {
  std::map<v1::State, int> states;
  for (const JobReport& job : report.jobs) ++states[job.job.state()];
  const int ended = states[v1::DONE] + states[v1::FAILED] + states[v1::CANCELLED];
  std::string html =
      fmt::format("<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Session {}</title><style>{}</style></head><body>\n",
                  Escape(report.session), kStyle);
  html += fmt::format("<h1>Session {}</h1>\n<p class=\"note\">{} at {}</p>\n", Escape(report.session), When(report.made), Escape(report.scheduler));
  html += fmt::format("<p><b>{} of {} jobs done</b>, {} failed, {} cancelled, {} not ended.", states[v1::DONE], report.jobs.size(),
                      states[v1::FAILED], states[v1::CANCELLED], static_cast<int>(report.jobs.size()) - ended);
  if (report.fleet.workers() > 0) html += fmt::format(" {} workers are connected.", report.fleet.workers());
  if (!report.fleet.description().empty()) html += fmt::format(" {}.", Escape(report.fleet.description()));
  html += "</p>\n" + ListJobs(report);
  for (const JobReport& job : report.jobs) html += Describe(job);
  return html + DescribeTimeline(report.timeline) + Versions(report) + "</body></html>\n";
}

}  // namespace vorocast::report
