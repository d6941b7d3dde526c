// SPDX-License-Identifier: AGPL-3.0-or-later
// Makes what the paper's Table 1 compares, and times it: paper_table OUT_FOLDER
//
// On the first frame of each take: voxels of 2 cm (marching cubes), Delaunay refinement whose balls have at most the voxels' diagonal as radius (as
// diameter, which is how the paper puts it, it makes five times as many tetrahedra as voxels, and the paper says about as many), and clipped Voronoi
// cells, as many as there are voxels, after 0 and 10 iterations from a random start, as the paper has it, and after 10 from the lattice that
// is the default here. Times are CPU seconds and begin with the shape (the Poisson surface), which all of them share. Results go into files, to be
// judged by evaluate_cells, evaluate_surface and evaluate_tracking: here nothing is judged. times.json says what is where and what it took.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "services/storage/hdf5_artifacts.h"
#include "tests/bench/bench_report.h"
#include "tests/bench/paper_runtime.h"
#include "tests/bench/paper_takes.h"
#include "tests/bench/peer_cgal_mesh.h"
#include "tests/bench/voxels.h"
#include "workers/cvt/indicator.h"
#include "workers/cvt/solid.h"
#include "workers/cvt/tessellate.h"

namespace vorocast::bench {
namespace {

constexpr double kVoxel_m = 0.02;
constexpr std::int32_t kFrames = 10;  // a window of the paper

absl::Status WriteOff(const std::filesystem::path& path, const geometry::TriangleMesh& mesh) {
  std::ofstream file(path);
  file << fmt::format("OFF\n{} {} 0\n", mesh.vertices.size(), mesh.triangles.size());
  for (const geometry::Vec3& x : mesh.vertices) file << fmt::format("{:.9g} {:.9g} {:.9g}\n", x.x(), x.y(), x.z());
  for (const auto& [a, b, c] : mesh.triangles) file << fmt::format("3 {} {} {}\n", a, b, c);
  return file.flush() ? absl::OkStatus() : absl::UnknownError(fmt::format("{}: could not be written; is the disk full?", path.string()));
}

/// Table 1 on one frame. Every file is in `folder`.
class Table {
 public:
  Table(const std::filesystem::path& folder, geometry::OrientedPoints points) : folder_(folder), points_(std::move(points)) {}

  absl::StatusOr<nlohmann::json> Fill() {
    ASSIGN_OR_RETURN(shape_, cvt::ShapeFromPoints(points_, {}, nullptr));
    ASSIGN_OR_RETURN(const std::int32_t cells, AddVoxels());
    RETURN_IF_ERROR(AddDelaunay());
    RETURN_IF_ERROR(AddCvt("CVT, 0 iterations", "cvt_0.h5", {.cells = cells, .iterations = 0, .start = cvt::Start::kRandom}));
    RETURN_IF_ERROR(AddCvt("CVT, 10 iterations", "cvt_10.h5", {.cells = cells, .iterations = 10, .start = cvt::Start::kRandom}));
    RETURN_IF_ERROR(AddCvt("CVT, 10 iterations, lattice start", "cvt_10_lattice.h5", {.cells = cells, .iterations = 10}));
    return rows_;
  }

 private:
  absl::StatusOr<std::int32_t> AddVoxels() {
    const double begin = CpuSeconds();
    Voxels voxels = MakeVoxels(shape_.surface, kVoxel_m);
    const double cpu_s = CpuSeconds() - begin;
    const std::size_t cells = voxels.cubes.size();
    RETURN_IF_ERROR(WriteOff(folder_ / "voxels.off", voxels.surface));
    Row("Voxels (marching cubes)", "voxels.off", cells, cpu_s);
    RETURN_IF_ERROR(WriteCells("cubes.h5", std::move(voxels.cubes)));
    return static_cast<std::int32_t>(cells);
  }

  absl::Status AddDelaunay() {
    const double begin = CpuSeconds();
    Tetrahedra mesh;
    // Each solid alone: started on all together, refinement may never find the smaller ones.
    for (std::int32_t component = 0; component < shape_.component_count; ++component) {
      const cvt::Solid solid = cvt::SolidOf(shape_, component);
      ASSIGN_OR_RETURN(const Tetrahedra part, CgalDelaunayRefinement({solid.vertices, solid.triangles, {}}, std::sqrt(3.0) * kVoxel_m));
      const auto first = static_cast<std::int32_t>(mesh.vertices.size());
      mesh.vertices.insert(mesh.vertices.end(), part.vertices.begin(), part.vertices.end());
      for (const auto& [a, b, c, d] : part.tetrahedra) mesh.tetrahedra.push_back({first + a, first + b, first + c, first + d});
    }
    Row("Delaunay refinement", "delaunay.h5", mesh.tetrahedra.size(), CpuSeconds() - begin);
    return WriteCells("delaunay.h5", CellsOf(mesh));
  }

  absl::Status AddCvt(const std::string& method, const std::string& file, const cvt::TessellateOptions& options) {
    const double begin = CpuSeconds();
    absl::StatusOr<geometry::Cells> cells = cvt::Tessellate(shape_, options, nullptr, {});
    if (!cells.ok()) {
      // The other rows are worth having without this one.
      fmt::print("  {:<36} failed: {}\n", method, std::string(cells.status().message()));
      rows_.push_back({{"method", method}, {"file", nullptr}});
      return absl::OkStatus();
    }
    Row(method, file, cells->size(), CpuSeconds() - begin);
    return WriteCells(file, *std::move(cells));
  }

  absl::Status WriteCells(const std::string& file, geometry::Cells cells) const {
    cells.surface = points_;
    return storage::WriteCells(folder_ / file, cells, {.kind = "tessellate", .options_json = "{}"});
  }

  void Row(const std::string& method, const std::string& file, std::size_t cells, double cpu_s) {
    rows_.push_back({{"method", method}, {"file", file}, {"cells", cells}, {"cpu_s", cpu_s}});
    fmt::print("  {:<36} {:>6} cells  CPU {:.3f} s\n", method, cells, cpu_s);
    std::fflush(stdout);
  }

  std::filesystem::path folder_;
  geometry::OrientedPoints points_;
  cvt::Shape shape_;
  nlohmann::json rows_ = nlohmann::json::array();
};

absl::Status Run(const std::filesystem::path& out) {
  std::filesystem::remove_all(out);
  ASSIGN_OR_RETURN(const std::vector<PaperTake> takes, OpenPaperTakes(out / "takes", kFrames));
  nlohmann::json times = nlohmann::json::array();
  for (const PaperTake& take : takes) {
    std::filesystem::create_directories(out / take.name);
    ASSIGN_OR_RETURN(geometry::OrientedPoints points, ReadPoints(take, 0));
    const std::size_t count = points.size();
    fmt::print("{}: {} points\n", take.name, count);
    ASSIGN_OR_RETURN(nlohmann::json rows, Table(out / take.name, std::move(points)).Fill());
    ASSIGN_OR_RETURN(const auto seconds, MeasureRunTime(take, out / take.name / "tracked.h5"));
    times.push_back({{"take", take.name}, {"points", count}, {"rows", std::move(rows)}, {"run_time", seconds}, {"truth", take.truth.string()}});
  }
  std::ofstream file(out / "times.json");
  file << times.dump(2) << "\n";
  return file.flush() ? absl::OkStatus()
                      : absl::UnknownError(fmt::format("{}: could not be written; is the disk full?", (out / "times.json").string()));
}

}  // namespace
}  // namespace vorocast::bench

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: paper_table OUT_FOLDER\n");
    return 2;
  }
  const absl::Status status = vorocast::bench::Run(argv[1]);
  if (!status.ok()) fmt::print(stderr, "paper_table: {}\n", std::string(status.message()));
  return status.ok() ? 0 : 1;
}
