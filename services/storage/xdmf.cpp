// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/xdmf.h"

#include <fstream>
#include <initializer_list>
#include <set>
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
std::string Grid(std::string_view name, std::size_t n, double time, const std::string& positions, const std::string& attributes) {
  return fmt::format(R"(      <Grid Name="{}" GridType="Uniform">
        <Time Value="{}"/>
        <Topology TopologyType="Polyvertex" NumberOfElements="{}" NodesPerElement="1"/>
        <Geometry GeometryType="XYZ">{}</Geometry>
{}      </Grid>
)",
                     name, time, n, positions, attributes);
}

/// What stays the same over time: read from the cells layout below `group` of `file`.
std::string ShapeAttributes(const fs::path& file, const std::string& group, std::size_t n) {
  const std::string count = std::to_string(n);
  return Attribute("volume", Item(file, group + "/cells/volume", count, kDouble)) +
         Attribute("depth", Item(file, group + "/cells/depth", count, kDouble)) +
         Attribute("component", Item(file, group + "/cells/component", count, kInt));
}

/// Grids over time.
struct Collection {
  std::string_view name;
  std::string grids;
};

/// Collections without a grid are left out: readers stumble over them.
absl::Status WriteDocument(const fs::path& path, std::initializer_list<Collection> collections) {
  std::ofstream file(path);
  file << "<?xml version=\"1.0\"?>\n<Xdmf Version=\"3.0\">\n  <Domain>\n";
  for (const auto& [name, grids] : collections) {
    if (grids.empty()) continue;
    file << "    <Grid Name=\"" << name << "\" GridType=\"Collection\" CollectionType=\"Temporal\">\n" << grids << "    </Grid>\n";
  }
  file << "  </Domain>\n</Xdmf>\n";
  file.close();
  if (!file) return absl::UnavailableError(fmt::format("{}: cannot be written", path.string()));
  return absl::OkStatus();
}

fs::path MovedFile(const fs::path& xdmf) { return fs::absolute(xdmf.string() + ".h5"); }

/// Where a pose puts a cell's centroid.
Vec3 Moved(const Vec3& centroid, const Eigen::Vector4f& q, const Vec3& translation) {
  return geometry::Quat(q[0], q[1], q[2], q[3]).normalized() * centroid + translation;
}

absl::Status WriteCellsXdmf(const fs::path& artifact, const fs::path& xdmf) {
  ASSIGN_OR_RETURN(const CellsSummary summary, ReadCellsSummary(artifact));
  const auto n = static_cast<std::size_t>(summary.cell_count);
  const fs::path file = fs::absolute(artifact);
  const std::string positions = Item(file, "/cells/centroid", fmt::format("{} 3", n), kDouble);
  return WriteDocument(xdmf, {{"take", Grid("cells", n, 0, positions, ShapeAttributes(file, "", n))}});
}

/// The frames or instants of a take in the making: datasets in the moved file, grids in the document.
class TakeXdmf {
 public:
  TakeXdmf(const fs::path& xdmf, const fs::path& tracked, const geometry::TrackedTake& take)
      : xdmf_(xdmf), moved_file_(MovedFile(xdmf)), centroid_(take.model.cells.centroid), moved_(moved_file_) {
    const fs::path file = fs::absolute(tracked);
    const std::size_t n = centroid_.size();
    constant_ = ShapeAttributes(file, "/template", n) + Attribute("patch", Item(file, "/template/patch", std::to_string(n), kInt));
  }

  /// Cells at their centroids. `state` and `scale` may be null.
  void Add(double time, const Eigen::Vector4f* rotation, const Vec3* translation, const geometry::CellState* state, const float* scale) {
    const std::size_t n = centroid_.size();
    std::vector<Vec3> points;
    for (std::size_t c = 0; c < n; ++c) points.push_back(Moved(centroid_[c], rotation[c], translation[c]));
    const std::string position = Stored<float>("/position", {n, 3}, reinterpret_cast<const double*>(points.data()), kSingle);
    std::string attributes = constant_;
    if (state) attributes += Attribute("state", Stored<std::uint8_t>("/state", {n}, reinterpret_cast<const std::uint8_t*>(state), kByte));
    if (scale) attributes += Attribute("scale", Stored<float>("/scale", {n}, scale, kSingle));
    cells_ += Grid("cells", n, time, position, attributes);
  }

  /// The copies that are there, at their cells' centroids.
  void AddCopies(double time, const geometry::CellCopies& copies, std::size_t step) {
    if (copies.offset.empty()) return;
    const auto first = static_cast<std::size_t>(copies.offset[step]);
    const std::size_t n = static_cast<std::size_t>(copies.offset[step + 1]) - first;
    if (n == 0) return;
    std::vector<Vec3> points;
    for (std::size_t row = first; row < first + n; ++row)
      points.push_back(Moved(centroid_[static_cast<std::size_t>(copies.cell[row])], copies.rotation[row], copies.translation[row].cast<double>()));
    const std::string position = Stored<float>("/copies_position", {n, 3}, reinterpret_cast<const double*>(points.data()), kSingle);
    copies_ += Grid("copies", n, time, position,
                    Attribute("copy", Stored<std::int32_t>("/copies_copy", {n}, &copies.copy[first], kInt)) +
                        Attribute("cell", Stored<std::int32_t>("/copies_cell", {n}, &copies.cell[first], kInt)) +
                        Attribute("scale", Stored<float>("/copies_scale", {n}, &copies.scale[first], kSingle)));
  }

  /// The pairs of a morph that are on their way or have arrived, at their middles.
  void AddPairs(double time, const geometry::CellMorphs& morph, std::size_t step) {
    const std::size_t pairs = morph.source.size();
    std::vector<geometry::Vec3f> points;
    std::vector<std::int32_t> source, target;
    std::vector<float> blend, scale;
    for (std::size_t p = 0; p < pairs; ++p) {
      const std::size_t i = step * pairs + p;
      if (morph.blend[i] == 0) continue;
      points.push_back(morph.translation[i]);
      source.push_back(morph.source[p]);
      target.push_back(morph.target[p]);
      blend.push_back(morph.blend[i]);
      scale.push_back(morph.scale[i]);
    }
    const std::size_t n = points.size();
    if (n == 0) return;
    const std::string position = Stored<float>("/pairs_position", {n, 3}, reinterpret_cast<const float*>(points.data()), kSingle);
    pairs_ += Grid("pairs", n, time, position,
                   Attribute("source", Stored<std::int32_t>("/pairs_source", {n}, source.data(), kInt)) +
                       Attribute("target", Stored<std::int32_t>("/pairs_target", {n}, target.data(), kInt)) +
                       Attribute("blend", Stored<float>("/pairs_blend", {n}, blend.data(), kSingle)) +
                       Attribute("scale", Stored<float>("/pairs_scale", {n}, scale.data(), kSingle)));
  }

  /// What is added after this belongs to the next instant.
  void EndInstant() { ++instant_; }

  absl::Status Finish() {
    RETURN_IF_ERROR(moved_.Finish());
    return WriteDocument(xdmf_, {{"take", cells_}, {"copies", copies_}, {"pairs", pairs_}});
  }

 private:
  /// Stores values of the instant in the moved file, as a dataset of `group` with the instant's number, and returns the item that names it.
  template <typename Type, typename T>
  std::string Stored(const std::string& group, const std::vector<hsize_t>& shape, const T* values, std::string_view type) {
    if (groups_.insert(group).second) moved_.Group(group);
    const std::string name = fmt::format("{}/{:06}", group, instant_);
    moved_.Dataset<Type>(name, shape, values);
    return Item(moved_file_, name, shape.size() == 1 ? std::to_string(shape[0]) : fmt::format("{} {}", shape[0], shape[1]), type);
  }

  fs::path xdmf_;
  fs::path moved_file_;
  const std::vector<Vec3>& centroid_;
  Hdf5Writer moved_;
  std::set<std::string> groups_;  // of the moved file
  std::string constant_;
  std::string cells_, copies_, pairs_;  // grids
  std::size_t instant_ = 0;
};

absl::Status WriteTrackedXdmf(const fs::path& artifact, const fs::path& xdmf) {
  ASSIGN_OR_RETURN(const geometry::TrackedTake take, ReadTrackedTake(artifact));
  TakeXdmf document(xdmf, artifact, take);
  for (std::size_t f = 0; f < take.frame_count(); ++f) {
    const double time = (take.patches.frames[f] - take.patches.frames[0]) / take.frames_per_second;
    const std::size_t row = f * take.cell_count();
    document.Add(time, &take.cell_rotation[row], &take.cell_translation[row], nullptr, nullptr);
    document.EndInstant();
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
    const float* scale = take.cell_scale.empty() ? nullptr : &take.cell_scale[s * n];
    document.Add(take.time[s], &take.cell_rotation[s * n], &take.cell_translation[s * n], &take.cell_state[s * n], scale);
    document.AddCopies(take.time[s], take.copies, s);
    document.AddPairs(take.time[s], take.morph, s);
    document.EndInstant();
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
