// SPDX-License-Identifier: AGPL-3.0-or-later
#include <draco/compression/decode.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/compression/point_cloud/point_cloud_kd_tree_decoder.h>
#include <draco/compression/point_cloud/point_cloud_sequential_decoder.h>
#include <draco/core/varint_decoding.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <exception>
#include <memory>

#include "services/capture/frame_parser.h"

namespace vorocast::capture {
namespace {

using geometry::Rgb8;
using geometry::Vec3;

/// Draco allocates what a stream declares before it has read the data, and a damaged byte can declare anything. The decoders below stop
/// at declarations that no capture of this size makes: captures take half a byte to several bytes a vertex and a face.
constexpr std::uint64_t kElementsPerByte = 8;
constexpr std::uint64_t kElementsSlack = 4096;
/// Decoded bytes of all attributes to bytes of the file: 8 elements a byte with position, normal, colour and texture coordinates.
constexpr std::uint64_t kDecodedPerByte = kElementsPerByte * 48;
constexpr std::uint64_t kDecodedSlack = 1 << 20;

struct Budget {
  std::uint64_t file_bytes = 0;
  std::string refusal;  // why decoding was stopped, if this is why

  bool Allows(const char* what, std::uint64_t count) {
    if (count <= kElementsPerByte * file_bytes + kElementsSlack) return true;
    refusal =
        fmt::format("declares {} {} in {} bytes: the file is truncated or damaged; copy it again from the capture stage", count, what, file_bytes);
    return false;
  }

  bool AllowsAttributes(const draco::PointCloud& cloud) {
    std::uint64_t bytes = 0;
    for (int i = 0; i < cloud.num_attributes(); ++i) {
      const draco::PointAttribute& attribute = *cloud.attribute(i);
      // Some decoders also keep four bytes a component while they work.
      const auto size = static_cast<std::uint64_t>(draco::DataTypeLength(attribute.data_type())) + 4;
      bytes += cloud.num_points() * static_cast<std::uint64_t>(attribute.num_components()) * size;
    }
    if (bytes <= kDecodedPerByte * file_bytes + kDecodedSlack) return true;
    refusal =
        fmt::format("declares {} bytes of attributes in {} bytes: the file is damaged; copy it again from the capture stage", bytes, file_bytes);
    return false;
  }
};

/// Both counts of a mesh stand at the front of its connectivity, as variable-length integers.
bool AllowsMesh(draco::DecoderBuffer front, bool edgebreaker, Budget& budget) {
  std::uint8_t traversal = 0;
  std::uint32_t first = 0;
  std::uint32_t second = 0;
  if (edgebreaker && !front.Decode(&traversal)) return false;
  if (!draco::DecodeVarint(&first, &front) || !draco::DecodeVarint(&second, &front)) return false;
  return budget.Allows("vertices or faces", std::max(first, second));
}

class GuardedEdgebreaker : public draco::MeshEdgebreakerDecoder {
 public:
  explicit GuardedEdgebreaker(Budget& budget) : budget_(budget) {}

 protected:
  bool DecodeConnectivity() override { return AllowsMesh(*buffer(), true, budget_) && MeshEdgebreakerDecoder::DecodeConnectivity(); }
  bool DecodeAllAttributes() override { return budget_.AllowsAttributes(*point_cloud()) && MeshEdgebreakerDecoder::DecodeAllAttributes(); }

 private:
  Budget& budget_;
};

class GuardedSequentialMesh : public draco::MeshSequentialDecoder {
 public:
  explicit GuardedSequentialMesh(Budget& budget) : budget_(budget) {}

 protected:
  bool DecodeConnectivity() override { return AllowsMesh(*buffer(), false, budget_) && MeshSequentialDecoder::DecodeConnectivity(); }
  bool DecodeAllAttributes() override { return budget_.AllowsAttributes(*point_cloud()) && MeshSequentialDecoder::DecodeAllAttributes(); }

 private:
  Budget& budget_;
};

/// For both decoders of point clouds, whose geometry is one 32-bit count.
template <typename Decoder>
class GuardedCloud : public Decoder {
 public:
  explicit GuardedCloud(Budget& budget) : budget_(budget) {}

 protected:
  bool DecodeGeometryData() override {
    std::int32_t points = 0;
    return this->buffer()->Peek(&points) && points >= 0 && budget_.Allows("points", static_cast<std::uint64_t>(points)) &&
           Decoder::DecodeGeometryData();
  }
  bool DecodeAllAttributes() override { return budget_.AllowsAttributes(*this->point_cloud()) && Decoder::DecodeAllAttributes(); }

 private:
  Budget& budget_;
};

absl::Status ToStatus(const draco::Status& status, const Budget& budget) {
  if (status.ok()) return absl::OkStatus();
  if (!budget.refusal.empty()) return absl::InvalidArgumentError(budget.refusal);
  return absl::InvalidArgumentError(
      fmt::format("Draco cannot decode it ({}): the file is truncated or damaged; copy it again from the capture stage", status.error_msg_string()));
}

struct Decoded {
  std::unique_ptr<draco::PointCloud> cloud;
  const draco::Mesh* mesh = nullptr;  // the same object, where it is a mesh
};

absl::StatusOr<Decoded> DecodeMesh(const draco::DracoHeader& header, draco::DecoderBuffer& buffer, Budget& budget) {
  if (DRACO_BITSTREAM_VERSION(header.version_major, header.version_minor) < DRACO_BITSTREAM_VERSION(2, 2)) {
    return absl::InvalidArgumentError(fmt::format("has the Draco bitstream {}.{}; 2.2 and later are read: encode it again with Draco 1.2 or later",
                                                  header.version_major, header.version_minor));
  }
  auto mesh = std::make_unique<draco::Mesh>();
  const draco::DecoderOptions options;
  if (header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING) {
    RETURN_IF_ERROR(ToStatus(GuardedEdgebreaker(budget).Decode(options, &buffer, mesh.get()), budget));
  } else if (header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING) {
    RETURN_IF_ERROR(ToStatus(GuardedSequentialMesh(budget).Decode(options, &buffer, mesh.get()), budget));
  } else {
    return absl::InvalidArgumentError(fmt::format("has the unknown Draco mesh method {}: the file is damaged", header.encoder_method));
  }
  const draco::Mesh* as_mesh = mesh.get();
  return Decoded{std::move(mesh), as_mesh};
}

absl::StatusOr<Decoded> DecodeCloud(const draco::DracoHeader& header, draco::DecoderBuffer& buffer, Budget& budget) {
  auto cloud = std::make_unique<draco::PointCloud>();
  const draco::DecoderOptions options;
  if (header.encoder_method == draco::POINT_CLOUD_SEQUENTIAL_ENCODING) {
    RETURN_IF_ERROR(ToStatus(GuardedCloud<draco::PointCloudSequentialDecoder>(budget).Decode(options, &buffer, cloud.get()), budget));
  } else if (header.encoder_method == draco::POINT_CLOUD_KD_TREE_ENCODING) {
    RETURN_IF_ERROR(ToStatus(GuardedCloud<draco::PointCloudKdTreeDecoder>(budget).Decode(options, &buffer, cloud.get()), budget));
  } else {
    return absl::InvalidArgumentError(fmt::format("has the unknown Draco point cloud method {}: the file is damaged", header.encoder_method));
  }
  return Decoded{std::move(cloud), nullptr};
}

/// One entry of an attribute as three numbers; false where the stream names an entry that it does not hold.
bool Load(const draco::PointAttribute& attribute, draco::AttributeValueIndex entry, Vec3& value) {
  std::array<float, 3> raw = {};
  if (entry.value() >= attribute.size() || !attribute.ConvertValue<float>(entry, 3, raw.data())) return false;
  value = Vec3(static_cast<double>(raw[0]), static_cast<double>(raw[1]), static_cast<double>(raw[2]));
  return true;
}

absl::Status Damaged() { return absl::InvalidArgumentError("Draco decoded an index that is out of range: the file is damaged; copy it again"); }

/// Sums a corner attribute over the points that share a position: Draco splits points where normals or colours differ.
absl::StatusOr<std::vector<Vec3>> MeanByPosition(const draco::PointCloud& cloud, const draco::PointAttribute& position,
                                                 const draco::PointAttribute& attribute) {
  std::vector<Vec3> sum(position.size(), Vec3::Zero());
  std::vector<double> count(position.size(), 0);
  for (draco::PointIndex point(0); point < cloud.num_points(); ++point) {
    const std::size_t vertex = position.mapped_index(point).value();
    Vec3 value;
    if (vertex >= sum.size() || !Load(attribute, attribute.mapped_index(point), value)) return Damaged();
    sum[vertex] += value;
    count[vertex] += 1;
  }
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] /= std::max(count[i], 1.0);
  return sum;
}

absl::Status ReadColours(const Decoded& decoded, const draco::PointAttribute& position, geometry::TriangleMesh& mesh) {
  const draco::PointAttribute* attribute = decoded.cloud->GetNamedAttribute(draco::GeometryAttribute::COLOR);
  if (attribute == nullptr || attribute->num_components() < 3) return absl::OkStatus();
  ASSIGN_OR_RETURN(const std::vector<Vec3> colours, MeanByPosition(*decoded.cloud, position, *attribute));
  const bool is_float = attribute->data_type() == draco::DT_FLOAT32 || attribute->data_type() == draco::DT_FLOAT64;
  // ConvertValue scales normalised integers to 0 … 1.
  const double scale = is_float || attribute->normalized() ? 255 : 1;
  for (const Vec3& c : colours) {
    Rgb8 colour;
    for (int i = 0; i < 3; ++i) colour[static_cast<std::size_t>(i)] = c[i] >= 0 ? static_cast<std::uint8_t>(std::min(scale * c[i] + 0.5, 255.0)) : 0;
    mesh.colours.push_back(colour);
  }
  return absl::OkStatus();
}

absl::Status ReadTriangles(const Decoded& decoded, const draco::PointAttribute& position, geometry::TriangleMesh& mesh) {
  for (draco::FaceIndex f(0); f < decoded.mesh->num_faces(); ++f) {
    std::array<std::int32_t, 3> triangle = {};
    for (std::size_t i = 0; i < 3; ++i) {
      const draco::PointIndex point = decoded.mesh->face(f)[i];
      if (point.value() >= decoded.cloud->num_points()) return Damaged();
      const std::uint32_t vertex = position.mapped_index(point).value();
      if (vertex >= position.size()) return Damaged();
      triangle[i] = static_cast<std::int32_t>(vertex);
    }
    if (triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[2] != triangle[0]) mesh.triangles.push_back(triangle);
  }
  return absl::OkStatus();
}

absl::StatusOr<RawFrame> ToRawFrame(const Decoded& decoded) {
  const draco::PointAttribute* position = decoded.cloud->GetNamedAttribute(draco::GeometryAttribute::POSITION);
  if (position == nullptr || position->num_components() != 3) return absl::InvalidArgumentError("holds no positions of three coordinates");
  RawFrame frame;
  frame.mesh.vertices.resize(position->size());
  for (std::size_t i = 0; i < position->size(); ++i) {
    if (!Load(*position, draco::AttributeValueIndex(static_cast<std::uint32_t>(i)), frame.mesh.vertices[i])) return Damaged();
  }
  const draco::PointAttribute* normal = decoded.cloud->GetNamedAttribute(draco::GeometryAttribute::NORMAL);
  if (normal != nullptr && normal->num_components() == 3) {
    ASSIGN_OR_RETURN(frame.normals, MeanByPosition(*decoded.cloud, *position, *normal));
  }
  RETURN_IF_ERROR(ReadColours(decoded, *position, frame.mesh));
  if (decoded.mesh != nullptr) RETURN_IF_ERROR(ReadTriangles(decoded, *position, frame.mesh));
  return frame;
}

}  // namespace

absl::StatusOr<RawFrame> ParseDraco(std::string_view bytes) try {
  Budget budget{.file_bytes = bytes.size(), .refusal = {}};
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  draco::DracoHeader header;
  draco::DecoderBuffer front = buffer;
  RETURN_IF_ERROR(ToStatus(draco::PointCloudDecoder::DecodeHeader(&front, &header), budget));
  if (header.encoder_type != draco::TRIANGULAR_MESH && header.encoder_type != draco::POINT_CLOUD) {
    return absl::InvalidArgumentError(fmt::format("holds the unknown Draco geometry {}: the file is damaged", header.encoder_type));
  }
  const bool is_mesh = header.encoder_type == draco::TRIANGULAR_MESH;
  ASSIGN_OR_RETURN(const Decoded decoded, is_mesh ? DecodeMesh(header, buffer, budget) : DecodeCloud(header, buffer, budget));
  return ToRawFrame(decoded);
} catch (const std::exception& error) {
  return absl::InvalidArgumentError(fmt::format("Draco gave up on it ({}): the file is damaged; copy it again from the capture stage", error.what()));
}

}  // namespace vorocast::capture
