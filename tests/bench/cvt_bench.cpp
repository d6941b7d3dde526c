// SPDX-License-Identifier: AGPL-3.0-or-later
// What a tessellation costs and how good it is (CPU seconds of one core, G3, distances of the points to the surface), beside the goals and beside
// what CGAL, TetGen, voro++ and a voxel grid make of the same shape in the same run.
//   bench_cvt [FRAME] [--json FILE]   FRAME: a file in metres, y up; by default crane's first frame if it is there, else a made-up one
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "services/base/random.h"
#include "services/capture/frame_reader.h"
#include "services/geometry/triangle_mesh.h"
#include "tests/bench/bench_inputs.h"
#include "tests/bench/bench_report.h"
#include "tests/bench/peer_cgal_mesh.h"
#include "tests/bench/peer_tetgen.h"
#include "tests/bench/peer_voro.h"
#include "tests/bench/surface_distance.h"
#include "tests/bench/tetrahedra.h"
#include "tests/bench/voxels.h"
#include "workers/cvt/indicator.h"
#include "workers/cvt/tessellate.h"

namespace vorocast::bench {
namespace {

using geometry::Cells;
using geometry::Vec3;

struct Setting {
  std::int32_t cells, iterations;
  double goal_cpu_s, goal_g3;
};
constexpr Setting kSettings[] = {{5000, 10, 0.40, 0.0819}, {5000, 50, 1.6, 0.0807}, {14'455, 10, 1.0, 0.0814}};
/// Of the voxels' distance sum, with as many cells (the paper reaches 0.70).
constexpr double kGoalOfVoxels = 0.35;
/// Delaunay balls of this radius, in edges of a cube of a cell's volume, give about as many tetrahedra as cells.
constexpr double kDelaunayLength = 1.6;

/// What is tessellated: a shape, and the points it was made of, if any.
struct Subject {
  std::string name;
  cvt::Shape shape;
  geometry::OrientedPoints points;
  std::vector<Vec3> truth;  // as many points of the surface that was scanned, free of noise, if it is known
};

/// What a peer made and how long it took.
template <typename Result>
struct Made {
  Result result;
  double cpu_s = 0;
};

template <typename Make>
auto Timed(Make&& make) -> absl::StatusOr<Made<typename std::invoke_result_t<Make>::value_type>> {
  const double begin = CpuSeconds();
  ASSIGN_OR_RETURN(auto result, make());
  return Made<typename std::invoke_result_t<Make>::value_type>{std::move(result), CpuSeconds() - begin};
}

/// Something of about `count` cells, made by `make` for a length: tries lengths until the count is within a twentieth, four times at most.
template <typename Make, typename Count>
auto WithCells(std::int32_t count, double length, Make&& make, Count&& count_of) -> decltype(make(length)) {
  for (int attempt = 0;; ++attempt) {
    ASSIGN_OR_RETURN(auto made, make(length));
    const double ratio = static_cast<double>(count_of(made.result)) / count;
    if (std::abs(ratio - 1) < 0.05 || attempt == 3) return made;
    length *= std::cbrt(ratio);
  }
}

std::size_t TetrahedronCount(const Tetrahedra& mesh) { return mesh.tetrahedra.size(); }

void AddPointSums(const Subject& subject, const geometry::TriangleMesh& surface, std::map<std::string, double>& quality) {
  if (subject.points.size() > 0) quality["point_sum_m"] = DistancesTo(surface, subject.points.positions).sum;
  if (!subject.truth.empty()) quality["truth_sum_m"] = DistancesTo(surface, subject.truth).sum;
}

/// The edge of a cube that holds one cell's share of the volume.
double CubeEdge(const Subject& subject, std::int32_t cells) { return std::cbrt(geometry::SignedVolume(subject.shape.surface) / cells); }

void DescribeTetrahedra(const Tetrahedra& mesh, const Subject& subject, BenchCase& one) {
  const Cells cells = CellsOf(mesh);
  one.peer_quality = {{"cells", static_cast<double>(cells.size())}, {"g3", geometry::NormalisedSecondMoment(cells)}};
  AddPointSums(subject, SurfaceOf(cells), one.peer_quality);
}

absl::Status AddDelaunay(const Subject& subject, const Setting& setting, BenchCase& one) {
  const auto make = [&](double length) { return Timed([&] { return CgalDelaunayRefinement(subject.shape.surface, length); }); };
  ASSIGN_OR_RETURN(const auto made, WithCells(setting.cells, kDelaunayLength * CubeEdge(subject, setting.cells), make, TetrahedronCount));
  one.peer = "CGAL 5.5 Mesh_3 (tetrahedra)";
  one.peer_cpu_s = made.cpu_s;
  DescribeTetrahedra(made.result, subject, one);
  return absl::OkStatus();
}

/// TetGen keeps the surface it is given, so it is given one of few and well-shaped triangles: Mesh_3's, whose making is not counted.
absl::Status AddTetGen(const Subject& subject, const Setting& setting, BenchCase& one) {
  const auto make = [&](double length) -> absl::StatusOr<Made<Tetrahedra>> {
    ASSIGN_OR_RETURN(const Tetrahedra coarse, CgalDelaunayRefinement(subject.shape.surface, length));
    const geometry::TriangleMesh surface = SurfaceOf(CellsOf(coarse));
    return Timed([&] { return TetGenMesh(surface, 1.6 * length * length * length); });
  };
  ASSIGN_OR_RETURN(const auto made, WithCells(setting.cells, kDelaunayLength * CubeEdge(subject, setting.cells), make, TetrahedronCount));
  one.peer = "TetGen 1.5 (tetrahedra, of Mesh_3's surface)";
  one.peer_cpu_s = made.cpu_s;
  DescribeTetrahedra(made.result, subject, one);
  return absl::OkStatus();
}

absl::Status AddVoxels(const Subject& subject, const Setting& setting, BenchCase& one) {
  const auto make = [&](double length) { return Timed([&]() -> absl::StatusOr<Voxels> { return MakeVoxels(subject.shape.surface, length); }); };
  ASSIGN_OR_RETURN(const auto voxels,
                   WithCells(setting.cells, CubeEdge(subject, setting.cells), make, [](const Voxels& made) { return made.cubes.size(); }));
  one.peer = "voxels, marching cubes";
  one.peer_cpu_s = voxels.cpu_s;
  one.peer_quality = {{"cells", static_cast<double>(voxels.result.cubes.size())},
                      {"point_sum_blocks_m", DistancesTo(SurfaceOf(voxels.result.cubes), subject.points.positions).sum}};
  AddPointSums(subject, voxels.result.surface, one.peer_quality);
  one.quality["point_sum_of_voxels"] = one.quality["point_sum_m"] / one.peer_quality["point_sum_m"];
  one.goal["point_sum_of_voxels"] = kGoalOfVoxels;
  if (!subject.truth.empty()) {
    // Without the noise, which is the same for both.
    one.quality["truth_sum_of_voxels"] = one.quality["truth_sum_m"] / one.peer_quality["truth_sum_m"];
    one.goal["truth_sum_of_voxels"] = kGoalOfVoxels;
  }
  return absl::OkStatus();
}

absl::StatusOr<BenchCase> Measure(const Subject& subject, const Setting& setting, cvt::Start start, int runs) {
  cvt::TessellateOptions options;
  options.cells = setting.cells;
  options.iterations = setting.iterations;
  options.start = start;
  BenchCase one;
  one.name = fmt::format("cvt-{}-{}", setting.cells, setting.iterations);
  one.input = subject.name;
  Cells cells;
  for (int run = 0; run < runs; ++run) {
    cvt::TessellateSummary summary;
    const double begin = CpuSeconds();
    ASSIGN_OR_RETURN(cells, cvt::Tessellate(subject.shape, options, &summary, {}));
    // The least of the runs: the machine's other work only ever adds.
    const double cpu_s = CpuSeconds() - begin;
    one.cpu_s = run == 0 ? cpu_s : std::min(one.cpu_s, cpu_s);
    one.quality = {{"g3", geometry::NormalisedSecondMoment(cells)}, {"evaluations", static_cast<double>(summary.evaluations)}};
  }
  AddPointSums(subject, SurfaceOf(cells), one.quality);
  one.goal = {{"cpu_s", setting.goal_cpu_s}, {"g3", setting.goal_g3}};
  return one;
}

absl::StatusOr<Subject> MeshSubject(const std::string& path) {
  ASSIGN_OR_RETURN(capture::Frame frame, capture::ReadFrame(path, {}));
  const std::string name = std::filesystem::path(path).parent_path().filename().string() + "/" + std::filesystem::path(path).filename().string();
  if (frame.mesh.triangles.empty()) {
    ASSIGN_OR_RETURN(cvt::Shape shape, cvt::ShapeFromPoints(frame.points, {}, nullptr));
    return Subject{name, std::move(shape), std::move(frame.points), {}};
  }
  ASSIGN_OR_RETURN(cvt::Shape shape, cvt::ShapeFromMesh(frame.mesh, {}, nullptr));
  return Subject{fmt::format("{}, mesh of {} triangles", name, shape.surface.triangles.size()), std::move(shape), {}, {}};
}

absl::StatusOr<Subject> ScanSubject() {
  ASSIGN_OR_RETURN(BenchFrame frame, CraneOrSynthFrame(0, kPaperPoints));
  ASSIGN_OR_RETURN(cvt::Shape shape, cvt::ShapeFromPoints(frame.points, {}, nullptr));
  Subject subject{fmt::format("{}, {} points, 1 mm noise, surface of {} triangles", frame.name, frame.points.size(), shape.surface.triangles.size()),
                  std::move(shape),
                  std::move(frame.points),
                  {}};
  if (frame.truth) subject.truth = geometry::SampleSurface(*frame.truth, kPaperPoints, 2).positions;
  return subject;
}

absl::Status BenchMesh(const Subject& subject, BenchReport& report) {
  for (const Setting& setting : kSettings) {
    ASSIGN_OR_RETURN(BenchCase one, Measure(subject, setting, cvt::Start::kLattice, 2));
    RETURN_IF_ERROR(setting.iterations == 50 ? AddTetGen(subject, setting, one) : AddDelaunay(subject, setting, one));
    report.Add(std::move(one));
  }
  ASSIGN_OR_RETURN(BenchCase random, Measure(subject, kSettings[0], cvt::Start::kRandom, 1));
  random.name += "-random";
  random.goal = {};
  report.Add(std::move(random));
  return absl::OkStatus();
}

absl::Status BenchScan(BenchReport& report) {
  ASSIGN_OR_RETURN(const Subject subject, ScanSubject());
  for (const Setting& setting : kSettings) {
    ASSIGN_OR_RETURN(BenchCase one, Measure(subject, setting, cvt::Start::kLattice, 2));
    one.name += "-scan";
    if (setting.iterations == 10) RETURN_IF_ERROR(AddVoxels(subject, setting, one));
    report.Add(std::move(one));
  }
  return absl::OkStatus();
}

geometry::TriangleMesh BoxMesh(const geometry::Box3& box) {
  geometry::TriangleMesh mesh;
  for (int corner = 0; corner < 8; ++corner) mesh.vertices.push_back(box.corner(static_cast<geometry::Box3::CornerType>(corner)));
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

/// One evaluation of cells with volumes and centroids, from a cold start, in a box of 1.8 m × 0.6 m × 0.6 m: what voro++ does.
absl::Status BenchBox(std::int32_t count, BenchReport& report) {
  const geometry::Box3 box(Vec3::Zero(), Vec3(1.8, 0.6, 0.6));
  ASSIGN_OR_RETURN(const cvt::Shape shape, cvt::ShapeFromSurface(BoxMesh(box), 0));
  base::Random random(7);
  std::vector<Vec3> sites;
  for (std::int32_t i = 0; i < count; ++i) sites.push_back(box.sizes().cwiseProduct(Vec3(random.Uniform(), random.Uniform(), random.Uniform())));
  BenchCase one;
  one.name = fmt::format("voronoi-box-{}", count);
  one.input = fmt::format("{} random sites in a box", count);
  double begin = CpuSeconds();
  ASSIGN_OR_RETURN(const cvt::ClippedMoments ours, cvt::EvaluateClippedCells(shape, sites, cvt::Neighbours::kGrid));
  one.cpu_s = CpuSeconds() - begin;
  begin = CpuSeconds();
  const BoxCells theirs = VoroCells(sites, box);
  one.peer = "voro++ 0.4.6";
  one.peer_cpu_s = CpuSeconds() - begin;
  double volume = 0, centroid = 0;
  for (std::size_t i = 0; i < sites.size(); ++i) {
    volume = std::max(volume, std::abs(ours.volume[i] - theirs.volume[i]) / theirs.volume[i]);
    centroid = std::max(centroid, (ours.centroid[i] - theirs.centroid[i]).norm());
  }
  one.quality = {{"volume_difference_max", volume}, {"centroid_difference_max_mm", 1000 * centroid}};
  report.Add(std::move(one));
  return absl::OkStatus();
}

absl::Status Bench(BenchReport& report) {
  const bool given = !report.arguments().empty();
  const std::string crane = (std::filesystem::path(DataFolder()) / "crane" / "frame_0000.ply").string();
  if (given || std::filesystem::exists(crane)) {
    ASSIGN_OR_RETURN(const Subject subject, MeshSubject(given ? report.arguments()[0] : crane));
    RETURN_IF_ERROR(BenchMesh(subject, report));
  } else {
    ASSIGN_OR_RETURN(const Subject subject, ScanSubject());
    RETURN_IF_ERROR(BenchMesh(subject, report));
  }
  if (!given) {
    RETURN_IF_ERROR(BenchScan(report));
    for (const std::int32_t count : {5000, 14'455}) RETURN_IF_ERROR(BenchBox(count, report));
  }
  return absl::OkStatus();
}

}  // namespace
}  // namespace vorocast::bench

int main(int argc, char** argv) { return vorocast::bench::RunBench("bench_cvt", argc, argv, vorocast::bench::Bench); }
