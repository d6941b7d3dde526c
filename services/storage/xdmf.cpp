// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/xdmf.h"

#include <fstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include "services/storage/artifact_file.h"

namespace vorocast::storage {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;

/// File names may hold anything.
std::string Escaped(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&') {
      escaped += "&amp;";
    } else if (c == '<') {
      escaped += "&lt;";
    } else if (c == '>') {
      escaped += "&gt;";
    } else if (c == '"') {
      escaped += "&quot;";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

/// A dataset of a file, as an XDMF item. `type`: NumberType and Precision attributes.
std::string Item(const fs::path& file, std::string_view dataset, std::string_view dimensions, std::string_view type) {
  return fmt::format(R"(<DataItem Dimensions="{}" {} Format="HDF">{}:{}</DataItem>)", dimensions, type, Escaped(file.string()), dataset);
}

constexpr std::string_view kDouble = R"(NumberType="Float" Precision="8")";
constexpr std::string_view kSingle = R"(NumberType="Float" Precision="4")";
constexpr std::string_view kInt = R"(NumberType="Int" Precision="4")";
constexpr std::string_view kByte = R"(NumberType="UChar" Precision="1")";

std::string Attribute(std::string_view name, const std::string& item) {
  return fmt::format("        <Attribute Name=\"{}\" AttributeType=\"Scalar\" Center=\"Node\">{}</Attribute>\n", name, item);
}

/// One instant: points with attributes.
std::string Grid(std::size_t n, double time, const std::string& positions, const std::string& attributes) {
  return fmt::format(R"(      <Grid Name="cells" GridType="Uniform">
        <Time Value="{}"/>
        <Topology TopologyType="Polyvertex" NumberOfElements="{}" NodesPerElement="1"/>
        <Geometry GeometryType="XYZ">{}</Geometry>
{}      </Grid>
)",
                     time, n, positions, attributes);
}

/// What stays the same over time: read from the cells layout below `group` of `file`.
std::string ShapeAttributes(const fs::path& file, const std::string& group, std::size_t n) {
  const std::string count = std::to_string(n);
  return Attribute("volume", Item(file, group + "/cells/volume", count, kDouble)) +
         Attribute("depth", Item(file, group + "/cells/depth", count, kDouble)) +
         Attribute("component", Item(file, group + "/cells/component", count, kInt));
}

absl::Status WriteDocument(const fs::path& path, const std::string& grids) {
  std::ofstream file(path);
  file << "<?xml version=\"1.0\"?>\n<Xdmf Version=\"3.0\">\n  <Domain>\n"
          "    <Grid Name=\"take\" GridType=\"Collection\" CollectionType=\"Temporal\">\n"
       << grids << "    </Grid>\n  </Domain>\n</Xdmf>\n";
  file.close();
  if (!file) return absl::UnavailableError(fmt::format("{}: cannot be written", path.string()));
  return absl::OkStatus();
}

fs::path MovedFile(const fs::path& xdmf) { return fs::absolute(xdmf.string() + ".h5"); }

/// Centroids of all cells at one instant.
std::vector<Vec3> Moved(const std::vector<Vec3>& centroid, const Eigen::Vector4f* rotation, const Vec3* translation) {
  std::vector<Vec3> moved(centroid.size());
  for (std::size_t c = 0; c < centroid.size(); ++c) {
    const Eigen::Vector4f& q = rotation[c];
    moved[c] = geometry::Quat(q[0], q[1], q[2], q[3]).normalized() * centroid[c] + translation[c];
  }
  return moved;
}

absl::Status WriteCellsXdmf(const fs::path& artifact, const fs::path& xdmf) {
  ASSIGN_OR_RETURN(const CellsSummary summary, ReadCellsSummary(artifact));
  const auto n = static_cast<std::size_t>(summary.cell_count);
  const fs::path file = fs::absolute(artifact);
  const std::string positions = Item(file, "/cells/centroid", fmt::format("{} 3", n), kDouble);
  return WriteDocument(xdmf, Grid(n, 0, positions, ShapeAttributes(file, "", n)));
}

/// The frames or instants of a take in the making: datasets in the moved file, grids in the document.
class TakeXdmf {
 public:
  TakeXdmf(const fs::path& xdmf, const fs::path& tracked, const geometry::TrackedTake& take)
      : xdmf_(xdmf), moved_file_(MovedFile(xdmf)), centroid_(take.model.cells.centroid), moved_(moved_file_) {
    const fs::path file = fs::absolute(tracked);
    const std::size_t n = centroid_.size();
    constant_ = ShapeAttributes(file, "/template", n) + Attribute("patch", Item(file, "/template/patch", std::to_string(n), kInt));
    moved_.Group("/position");
    moved_.Group("/state");
  }

  /// `state` may be null.
  void Add(double time, const Eigen::Vector4f* rotation, const Vec3* translation, const geometry::CellState* state) {
    const hsize_t n = centroid_.size();
    const std::vector<Vec3> moved = Moved(centroid_, rotation, translation);
    const std::string position = fmt::format("/position/{:06}", count_);
    moved_.Dataset<float>(position, {n, 3}, reinterpret_cast<const double*>(moved.data()));
    std::string attributes = constant_;
    if (state) {
      const std::string name = fmt::format("/state/{:06}", count_);
      moved_.Dataset<std::uint8_t>(name, {n}, reinterpret_cast<const std::uint8_t*>(state));
      attributes += Attribute("state", Item(moved_file_, name, std::to_string(n), kByte));
    }
    grids_ += Grid(n, time, Item(moved_file_, position, fmt::format("{} 3", n), kSingle), attributes);
    ++count_;
  }

  absl::Status Finish() {
    RETURN_IF_ERROR(moved_.Finish());
    return WriteDocument(xdmf_, grids_);
  }

 private:
  fs::path xdmf_;
  fs::path moved_file_;
  const std::vector<Vec3>& centroid_;
  Hdf5Writer moved_;
  std::string constant_;
  std::string grids_;
  std::size_t count_ = 0;
};

absl::Status WriteTrackedXdmf(const fs::path& artifact, const fs::path& xdmf) {
  ASSIGN_OR_RETURN(const geometry::TrackedTake take, ReadTrackedTake(artifact));
  TakeXdmf document(xdmf, artifact, take);
  for (std::size_t f = 0; f < take.frame_count(); ++f) {
    const double time = (take.patches.frames[f] - take.patches.frames[0]) / take.frames_per_second;
    const std::size_t row = f * take.cell_count();
    document.Add(time, &take.cell_rotation[row], &take.cell_translation[row], nullptr);
  }
  return document.Finish();
}

absl::Status WriteSimulatedXdmf(const fs::path& artifact, const fs::path& tracked, const fs::path& xdmf) {
  ASSIGN_OR_RETURN(const geometry::SimulatedTake take, ReadSimulatedTake(artifact));
  ASSIGN_OR_RETURN(const geometry::TrackedTake shapes, ReadTrackedTake(tracked));
  const std::size_t n = shapes.cell_count();
  if (take.cell_state.size() != take.time.size() * n) {
    return absl::InvalidArgumentError(
        fmt::format("{} has not the cells of {}; give the take that it was run on", artifact.string(), tracked.string()));
  }
  TakeXdmf document(xdmf, tracked, shapes);
  for (std::size_t s = 0; s < take.time.size(); ++s) {
    document.Add(take.time[s], &take.cell_rotation[s * n], &take.cell_translation[s * n], &take.cell_state[s * n]);
  }
  return document.Finish();
}

}  // namespace

absl::Status WriteXdmf(const fs::path& artifact, const fs::path& tracked, const fs::path& xdmf) {
  ASSIGN_OR_RETURN(const std::string content, ReadContent(artifact));
  if (content == kCellsContent) return WriteCellsXdmf(artifact, xdmf);
  if (content == kTrackedContent) return WriteTrackedXdmf(artifact, xdmf);
  if (content == kSimulatedContent) return WriteSimulatedXdmf(artifact, tracked, xdmf);
  return absl::InvalidArgumentError(fmt::format("{} holds \"{}\", which has no cells over time", artifact.string(), content));
}

}  // namespace vorocast::storage
