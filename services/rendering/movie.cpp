// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/movie.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace vorocast::rendering {
namespace {

constexpr std::int32_t kSideMax = 16384;  // libx264's
constexpr double kRateMax = 1000;

std::vector<std::string> Arguments(const std::filesystem::path& path, std::int32_t width, std::int32_t height, double frames_per_second) {
  return {"ffmpeg", "-nostdin", "-loglevel", "error", "-y",
          // what comes in
          "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", fmt::format("{}x{}", width, height), "-r", fmt::format("{:.6f}", frames_per_second), "-i",
          "pipe:0",
          // what goes out
          "-an", "-threads", "1", "-filter_threads", "1", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv", "-c:v",
          "libx264", "-preset", "fast", "-crf", "18", "-pix_fmt", "yuv420p", "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc",
          "iec61966-2-1", "-movflags", "+faststart", "-fflags", "+bitexact", "-flags:v", "+bitexact", "-map_metadata", "-1", "-f", "mp4",
          path.string()};
}

}  // namespace

absl::StatusOr<MovieWriter> MovieWriter::Open(const std::filesystem::path& path, std::int32_t width, std::int32_t height, double frames_per_second) {
  if (width < 2 || height < 2 || width > kSideMax || height > kSideMax || !(frames_per_second > 0 && frames_per_second <= kRateMax)) {
    return absl::InvalidArgumentError(fmt::format("no movie has {} × {} pixels at {} pictures a second: choose 2 to {} a side, at most {} a second",
                                                  width, height, frames_per_second, kSideMax, kRateMax));
  }
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return absl::InternalError(fmt::format("no pipe for ffmpeg: {}", std::strerror(errno)));
  ::signal(SIGPIPE, SIG_IGN);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_adddup2(&files, ends[0], STDIN_FILENO);
  std::vector<std::string> arguments = Arguments(path, width, height, frames_per_second);
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  pid_t pid = -1;
  // In this process's own group: what stops the task stops it too.
  const int failure = ::posix_spawnp(&pid, "ffmpeg", &files, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  ::close(ends[0]);
  if (failure != 0) {
    ::close(ends[1]);
    return absl::FailedPreconditionError(
        fmt::format("ffmpeg cannot be started ({}): install Debian's package ffmpeg on the workers", std::strerror(failure)));
  }
  return MovieWriter(pid, ends[1], width, height);
}

MovieWriter::MovieWriter(MovieWriter&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)), pipe_(std::exchange(other.pipe_, -1)), width_(other.width_), height_(other.height_) {}

MovieWriter::~MovieWriter() {
  if (pid_ < 0) return;
  ::kill(pid_, SIGKILL);
  (void)Wait();
}

absl::Status MovieWriter::Add(const Image& image) {
  if (image.width != width_ || image.height != height_) {
    return absl::InvalidArgumentError(fmt::format("a picture of {} × {} pixels in a movie of {} × {}", image.width, image.height, width_, height_));
  }
  for (std::size_t done = 0; done < image.rgb.size();) {
    const ssize_t count = ::write(pipe_, image.rgb.data() + done, image.rgb.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      const std::string cause = std::strerror(errno);
      const absl::Status ended = Wait();
      return ended.ok() ? absl::InternalError(fmt::format("ffmpeg takes no more pictures: {}", cause)) : ended;
    }
    done += static_cast<std::size_t>(count);
  }
  return absl::OkStatus();
}

absl::Status MovieWriter::Finish() { return Wait(); }

absl::Status MovieWriter::Wait() {
  ::close(std::exchange(pipe_, -1));
  int state = 0;
  pid_t waited = -1;
  do {
    waited = ::waitpid(pid_, &state, 0);
  } while (waited < 0 && errno == EINTR);
  pid_ = -1;
  if (waited > 0 && WIFEXITED(state) && WEXITSTATUS(state) == 0) return absl::OkStatus();
  return absl::InternalError(waited > 0 && WIFSIGNALED(state)
                                 ? fmt::format("ffmpeg was ended by signal {}", WTERMSIG(state))
                                 : fmt::format("ffmpeg failed with exit code {}; its words are in the task's log", WEXITSTATUS(state)));
}

}  // namespace vorocast::rendering
