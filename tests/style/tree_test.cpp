// SPDX-License-Identifier: AGPL-3.0-or-later
// Rules of the tree that the compiler does not know: which folder may include which, and what every source file has.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace vorocast {
namespace {

namespace fs = std::filesystem;
using testing::IsEmpty;

struct SourceFile {
  std::string path;  // from the project's root, '/' between
  std::vector<std::string> lines;
};

std::vector<SourceFile> SourceFiles() {
  std::vector<SourceFile> files;
  for (const char* top : {"services", "workers", "scheduler", "tests"}) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(VOROCAST_SOURCE_DIR) / top)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".h" && extension != ".cpp") continue;
      SourceFile& file = files.emplace_back();
      file.path = fs::relative(entry.path(), VOROCAST_SOURCE_DIR).generic_string();
      std::ifstream stream(entry.path());
      for (std::string line; std::getline(stream, line);) file.lines.push_back(line);
    }
  }
  return files;
}

std::vector<std::string> Includes(const SourceFile& file) {
  static const std::regex kInclude(R"re(^\s*#include\s+["<]([^">]+)[">])re");
  std::vector<std::string> includes;
  for (const std::string& line : file.lines) {
    if (std::smatch match; std::regex_search(line, match, kInclude)) includes.push_back(match[1]);
  }
  return includes;
}

std::string Top(const std::string& path) { return path.substr(0, path.find('/')); }

/// "services/geometry/cells.h" -> "services/geometry".
std::string Folder(const std::string& path) { return path.substr(0, path.rfind('/')); }

TEST(Tree, IncludesRespectTheLayers) {
  const std::map<std::string, std::set<std::string>> may_include = {
      {"services", {"proto", "services"}},
      {"workers", {"proto", "services", "workers"}},
      {"scheduler", {"proto", "services", "scheduler"}},
      {"tests", {"proto", "services", "workers", "scheduler", "tests"}},
  };
  const std::set<std::string> tops = {"proto", "services", "workers", "scheduler", "tests"};
  std::vector<std::string> breaches;
  for (const SourceFile& file : SourceFiles()) {
    for (const std::string& include : Includes(file)) {
      if (tops.contains(Top(include)) && !may_include.at(Top(file.path)).contains(Top(include)))
        breaches.push_back(file.path + " includes " + include);
    }
  }
  EXPECT_THAT(breaches, IsEmpty());
}

TEST(Tree, KernelsPlanAndCoreKnowNoMessages) {
  const std::set<std::string> pure = {"services/geometry", "workers/cvt", "workers/tracking", "scheduler/plan", "scheduler/core"};
  std::vector<std::string> breaches;
  for (const SourceFile& file : SourceFiles()) {
    if (!pure.contains(Folder(file.path))) continue;
    for (const std::string& include : Includes(file)) {
      if (Top(include) == "proto" || Top(include) == "google" || Top(include) == "grpcpp" || Top(include) == "grpc")
        breaches.push_back(file.path + " includes " + include);
    }
  }
  EXPECT_THAT(breaches, IsEmpty());
}

TEST(Tree, LibrariesStayInTheFoldersThatOwnThem) {
  const std::vector<std::pair<std::regex, std::set<std::string>>> owners = {
      {std::regex("^(hdf5|H5)"), {"services/storage"}},
      {std::regex("^CGAL/"), {"services/capture", "services/synth", "workers/cvt"}},
      {std::regex("^tetgen"), {"workers/cvt"}},
      {std::regex("^fftw3"), {"workers/cvt"}},
      {std::regex("^(bt[A-Z]|bullet/|BulletCollision|BulletDynamics|LinearMath)"), {"services/simulation"}},
      {std::regex("^embree3/"), {"services/rendering", "services/synth", "workers/cvt"}},
      {std::regex("^draco/"), {"services/capture"}},
      {std::regex("^png\\.h"), {"services/rendering"}},
      {std::regex("^sqlite3"), {"scheduler/store"}},
      {std::regex("^openssl/"), {"services/base", "services/rpc"}},  // digests; certificates and tokens
  };
  std::vector<std::string> breaches;
  for (const SourceFile& file : SourceFiles()) {
    if (Top(file.path) == "tests") continue;
    for (const std::string& include : Includes(file)) {
      for (const auto& [library, folders] : owners) {
        if (std::regex_search(include, library) && !folders.contains(Folder(file.path))) breaches.push_back(file.path + " includes " + include);
      }
    }
  }
  EXPECT_THAT(breaches, IsEmpty());
}

TEST(Tree, EverySourceFileStartsWithItsLicence) {
  std::vector<std::string> breaches;
  for (const SourceFile& file : SourceFiles()) {
    if (file.lines.empty() || file.lines[0] != "// SPDX-License-Identifier: AGPL-3.0-or-later") breaches.push_back(file.path);
    if (file.path.ends_with(".h") && (file.lines.size() < 2 || file.lines[1] != "#pragma once")) breaches.push_back(file.path + ": no #pragma once");
  }
  EXPECT_THAT(breaches, IsEmpty());
}

TEST(Tree, EveryBuildFileAndMessageStartsWithItsLicence) {
  std::vector<std::string> breaches;
  for (const char* top : {"cmake", "proto", "services", "workers", "scheduler", "tests", "deploy"}) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(VOROCAST_SOURCE_DIR) / top)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".cmake" && extension != ".proto" && extension != ".sh" && entry.path().filename() != "CMakeLists.txt") continue;
      std::ifstream stream(entry.path());
      std::string first, second;
      std::getline(stream, first);
      std::getline(stream, second);
      const std::string licence = "SPDX-License-Identifier: AGPL-3.0-or-later";
      if (first != "# " + licence && second != "# " + licence && first != "// " + licence) breaches.push_back(entry.path().string());
    }
  }
  EXPECT_THAT(breaches, IsEmpty());
}

TEST(Tree, NamesSayTheirSubject) {
  static const std::regex kVague("(^|_)(misc|utils?|helpers?|common|manager|stuff)(_|\\.)");
  std::vector<std::string> breaches;
  for (const SourceFile& file : SourceFiles()) {
    if (std::regex_search(fs::path(file.path).filename().string(), kVague)) breaches.push_back(file.path);
  }
  EXPECT_THAT(breaches, IsEmpty());
}

}  // namespace
}  // namespace vorocast
