// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/usd.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <iterator>
#include <span>
#include <string>

#include <fmt/format.h>

#include "services/interchange/pieces.h"

namespace vorocast::interchange {
namespace {

using geometry::Rigid3;
using geometry::Vec3;

/// "[a, b, c]", each item written by `write(index, out)`.
template <typename Write>
std::string List(std::size_t count, Write write) {
  std::string text = "[";
  auto out = std::back_inserter(text);
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0) text += ", ";
    write(i, out);
  }
  return text + "]";
}

std::string Triples(std::span<const Vec3> vectors) {
  return List(vectors.size(),
              [&](std::size_t i, auto& out) { fmt::format_to(out, "({:.6g}, {:.6g}, {:.6g})", vectors[i].x(), vectors[i].y(), vectors[i].z()); });
}

template <typename Number>
std::string Numbers(std::span<const Number> numbers) {
  return List(numbers.size(), [&](std::size_t i, auto& out) { fmt::format_to(out, "{}", numbers[i]); });
}

/// Faces as counts and indices; subdivision would round the cells.
std::string MeshBody(std::span<const Vec3> points, std::span<const std::int32_t> counts, std::span<const std::int32_t> indices,
                     const std::string& indent) {
  return fmt::format(
      "{0}uniform token subdivisionScheme = \"none\"\n{0}uniform token orientation = \"rightHanded\"\n{0}point3f[] points = {1}\n"
      "{0}int[] faceVertexCounts = {2}\n{0}int[] faceVertexIndices = {3}\n",
      indent, Triples(points), Numbers(counts), Numbers(indices));
}

std::string Subset(const char* name, std::span<const std::int32_t> faces, const char* colour, const std::string& indent) {
  return fmt::format(
      "{0}def GeomSubset \"{1}\"\n{0}{{\n{0}    uniform token elementType = \"face\"\n{0}    uniform token familyName = \"materialBind\"\n"
      "{0}    int[] indices = {2}\n{0}    rel material:binding = </Take/Materials/{3}>\n{0}}}\n",
      indent, name, Numbers(faces), colour);
}

std::string Material(const char* name, const char* colour) {
  return fmt::format(
      "        def Material \"{0}\"\n        {{\n            token outputs:surface.connect = </Take/Materials/{0}/Surface.outputs:surface>\n"
      "            def Shader \"Surface\"\n            {{\n                uniform token info:id = \"UsdPreviewSurface\"\n"
      "                color3f inputs:diffuseColor = {1}\n                float inputs:roughness = 0.7\n                token outputs:surface\n"
      "            }}\n        }}\n",
      name, colour);
}

std::string Prototype(const CellShape& shape, std::size_t cell) {
  std::vector<std::int32_t> counts, indices, skin, cut;
  for (std::size_t f = 0; f < shape.faces.size(); ++f) {
    const CellShape::Face& face = shape.faces[f];
    counts.push_back(static_cast<std::int32_t>(face.loop.size()));
    indices.insert(indices.end(), face.loop.begin(), face.loop.end());
    (face.skin ? skin : cut).push_back(static_cast<std::int32_t>(f));
  }
  const std::string indent(20, ' ');
  std::string text = fmt::format(
      "                def Mesh \"cell_{:05d}\" (\n                    prepend apiSchemas = [\"MaterialBindingAPI\"]\n"
      "                )\n                {{\n",
      cell);
  text += MeshBody(shape.vertices, counts, indices, indent);
  text += indent + "uniform token subsetFamily:materialBind:familyType = \"partition\"\n";
  if (!skin.empty()) text += Subset("skin", skin, "skin", indent);
  if (!cut.empty()) text += Subset("cut", cut, "cut", indent);
  return text + "                }\n";
}

/// Names in USD are letters, digits and underscores.
std::string Identifier(const std::string& name, std::size_t number) {
  std::string identifier;
  for (const char c : name) identifier += std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return fmt::format("object_{}_{}", number, identifier);
}

std::string Object(const MovingCells& take, std::size_t object) {
  const geometry::SceneObject& shown = take.objects[object];
  std::vector<std::int32_t> counts(shown.mesh.triangles.size(), 3), indices;
  for (const auto& triangle : shown.mesh.triangles) indices.insert(indices.end(), triangle.begin(), triangle.end());
  std::string text =
      fmt::format("    def Mesh \"{}\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    {{\n", Identifier(shown.name, object));
  text += MeshBody(shown.mesh.vertices, counts, indices, "        ");
  text += "        rel material:binding = </Take/Materials/object>\n        matrix4d xformOp:transform.timeSamples = {\n";
  for (std::size_t s = 0; s < take.instant_count(); ++s) {
    const Rigid3& pose = take.object_pose[s * take.objects.size() + object];
    const geometry::Mat3 r = pose.rotation.toRotationMatrix();
    // USD multiplies row vectors, so the rotation stands transposed and the translation in the last row.
    text += fmt::format("            {:.6g}: ( ({}, {}, {}, 0), ({}, {}, {}, 0), ({}, {}, {}, 0), ({}, {}, {}, 1) ),\n",
                        take.time[s] * take.frames_per_second, r(0, 0), r(1, 0), r(2, 0), r(0, 1), r(1, 1), r(2, 1), r(0, 2), r(1, 2), r(2, 2),
                        pose.translation.x(), pose.translation.y(), pose.translation.z());
  }
  return text + "        }\n        uniform token[] xformOpOrder = [\"xformOp:transform\"]\n    }\n";
}

std::string Head(const MovingCells& take) {
  return fmt::format(
      "#usda 1.0\n(\n    defaultPrim = \"Take\"\n    doc = \"Written by Vorocast\"\n    metersPerUnit = 1\n    upAxis = \"Y\"\n    startTimeCode = "
      "{:.6g}\n"
      "    endTimeCode = {:.6g}\n    timeCodesPerSecond = {:.6g}\n    framesPerSecond = {:.6g}\n)\n\ndef Xform \"Take\"\n{{\n",
      take.time.front() * take.frames_per_second, take.time.back() * take.frames_per_second, take.frames_per_second, take.frames_per_second);
}

/// The instants from `first` to `last`, both included.
struct Span {
  std::size_t first, last;
};
Span WholeTake(const MovingCells& take) { return {0, take.instant_count() - 1}; }

/// One attribute's time samples, one line an instant, written as they are made: a take's are too many to hold.
template <typename Value>
void WriteSamples(const MovingCells& take, const Span& span, const char* attribute, std::ofstream& file, Value value) {
  file << "        " << attribute << ".timeSamples = {\n";
  for (std::size_t s = span.first; s <= span.last; ++s)
    file << fmt::format("            {:.6g}: ", take.time[s] * take.frames_per_second) << value(s) << ",\n";
  file << "        }\n";
}

/// What is there from the first to the last instant of `span` only.
void WriteVisibility(const MovingCells& take, const Span& span, std::ofstream& file) {
  const Span around = {span.first == 0 ? 0 : span.first - 1, std::min(span.last + 1, take.instant_count() - 1)};
  WriteSamples(take, around, "token visibility", file,
               [&](std::size_t s) { return s < span.first || s > span.last ? "\"invisible\"" : "\"inherited\""; });
}

std::string Orientation(const geometry::Quat& q) { return fmt::format("({:.5g}, {:.5g}, {:.5g}, {:.5g})", q.w(), q.x(), q.y(), q.z()); }

/// What every instancer of cells says of its instances, which show the cells of `pieces`.
void WriteInstances(const MovingCells& take, std::span<const Piece> pieces, std::ofstream& file) {
  const auto per_instance = [&](const char* name, const std::vector<std::int32_t>& values) {
    file << "        int[] primvars:" << name << " = "
         << List(pieces.size(), [&](std::size_t i, auto& out) { fmt::format_to(out, "{}", values[static_cast<std::size_t>(pieces[i].cell)]); })
         << " (\n            interpolation = \"vertex\"\n        )\n";
  };
  file << "        int[] protoIndices = " << List(pieces.size(), [](std::size_t i, auto& out) { fmt::format_to(out, "{}", i); }) << "\n";
  per_instance("patch", take.model.patch);
  per_instance("component", take.model.cells.component);
  file << "        rel prototypes = "
       << List(pieces.size(), [&](std::size_t i, auto& out) { fmt::format_to(out, "</Take/Cells/Prototypes/cell_{:05d}>", pieces[i].cell); }) << "\n";
}

/// Where instances are, how large, and which are not there.
void WriteInstanceSamples(const MovingCells& take, std::span<const Piece> pieces, const Span& span, bool with_scales, std::ofstream& file,
                          const base::Progress& progress) {
  const double samples = 2.0 * static_cast<double>(span.last - span.first + 1);
  double done = 0;
  WriteSamples(take, span, "point3f[] positions", file, [&](std::size_t s) {
    std::vector<Vec3> positions;
    for (const Piece& piece : pieces) positions.push_back(PlacementOf(take, piece, s).world_from_shape.translation);
    base::Report(progress, ++done / samples);
    return Triples(positions);
  });
  WriteSamples(take, span, "quath[] orientations", file, [&](std::size_t s) {
    base::Report(progress, ++done / samples);
    return List(pieces.size(), [&](std::size_t i, auto& out) {
      out = std::ranges::copy(Orientation(PlacementOf(take, pieces[i], s).world_from_shape.rotation), out).out;
    });
  });
  if (with_scales) {
    WriteSamples(take, span, "float3[] scales", file, [&](std::size_t s) {
      return List(pieces.size(),
                  [&](std::size_t i, auto& out) { fmt::format_to(out, "({0:.4g}, {0:.4g}, {0:.4g})", PlacementOf(take, pieces[i], s).size); });
    });
  }
  WriteSamples(take, span, "int64[] invisibleIds", file, [&](std::size_t s) {
    std::vector<std::size_t> gone;
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      if (PlacementOf(take, pieces[i], s).size == 0) gone.push_back(i);
    }
    return Numbers<std::size_t>(gone);
  });
}

/// All cells of one copy of the performer: an instancer of its own, which has samples for its own time only.
void WriteCopy(const MovingCells& take, std::span<const Piece> pieces, std::ofstream& file) {
  Span span{pieces.front().first, pieces.front().last};
  for (const Piece& piece : pieces) span = {std::min(span.first, piece.first), std::max(span.last, piece.last)};
  file << fmt::format("    def PointInstancer \"copy_{:03d}\"\n    {{\n", pieces.front().copy);
  WriteInstances(take, pieces, file);
  WriteVisibility(take, span, file);
  WriteInstanceSamples(take, pieces, span, /*with_scales=*/true, file, {});
  file << "    }\n";
}

/// A cell that turns into another take's: a mesh whose points move within it while it does.
void WritePair(const MovingCells& take, const Piece& piece, const CellShape& shape, std::ofstream& file) {
  std::vector<std::int32_t> counts, indices;
  for (const CellShape::Face& face : shape.faces) {
    counts.push_back(static_cast<std::int32_t>(face.loop.size()));
    indices.insert(indices.end(), face.loop.begin(), face.loop.end());
  }
  const Span span{piece.first, piece.last};
  const auto placement = [&](std::size_t s) { return PlacementOf(take, piece, s); };
  file << fmt::format("    def Mesh \"{}\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    {{\n", piece.Name())
       << "        uniform token subdivisionScheme = \"none\"\n        uniform token orientation = \"rightHanded\"\n        int[] faceVertexCounts = "
       << Numbers<std::int32_t>(counts) << "\n        int[] faceVertexIndices = " << Numbers<std::int32_t>(indices)
       << "\n        rel material:binding = </Take/Materials/turning>\n";
  // Once it has arrived, its points stay where they are: the last samples would only repeat.
  std::size_t settled = span.last;
  while (settled > span.first && placement(settled - 1).blend == placement(span.last).blend) --settled;
  WriteSamples(take, {span.first, settled}, "point3f[] points", file, [&](std::size_t s) {
    std::vector<Vec3> points;
    const Placement here{.size = 1, .blend = placement(s).blend};
    for (std::size_t v = 0; v < shape.vertices.size(); ++v) points.push_back(WorldVertex(shape, here, v));
    return Triples(points);
  });
  WriteVisibility(take, span, file);
  WriteSamples(take, span, "double3 xformOp:translate", file, [&](std::size_t s) {
    const Vec3 x = placement(s).world_from_shape.translation;
    return fmt::format("({:.7g}, {:.7g}, {:.7g})", x.x(), x.y(), x.z());
  });
  WriteSamples(take, span, "quatf xformOp:orient", file, [&](std::size_t s) { return Orientation(placement(s).world_from_shape.rotation); });
  WriteSamples(take, span, "float3 xformOp:scale", file,
               [&](std::size_t s) { return fmt::format("({0:.6g}, {0:.6g}, {0:.6g})", placement(s).size); });
  file << "        uniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:orient\", \"xformOp:scale\"]\n    }\n";
}

}  // namespace

absl::Status WriteUsd(const MovingCells& take, const std::filesystem::path& path, const base::Progress& progress) {
  const std::vector<Piece> pieces = PiecesOf(take);
  const std::vector<CellShape> shapes = ShapesOf(take);
  const std::span<const Piece> all(pieces);
  const std::size_t n = take.cell_count();
  std::ofstream file(path, std::ios::trunc);
  file << Head(take);
  file << "    def Scope \"Materials\"\n    {\n"
       << Material("skin", "(0.80, 0.62, 0.48)") << Material("cut", "(0.45, 0.12, 0.08)") << Material("object", "(0.50, 0.50, 0.52)")
       << Material("turning", "(0.80, 0.62, 0.48)") << "    }\n";
  file << "    def PointInstancer \"Cells\"\n    {\n";
  WriteInstances(take, all.first(n), file);
  WriteInstanceSamples(take, all.first(n), WholeTake(take), !take.scale.empty(), file, progress);
  file << "        def Scope \"Prototypes\"\n        {\n";
  for (std::size_t c = 0; c < n; ++c) file << Prototype(shapes[c], c);
  file << "        }\n    }\n";
  for (std::size_t i = n; i < pieces.size();) {
    std::size_t end = i + 1;
    if (pieces[i].copy >= 0) {
      while (end < pieces.size() && pieces[end].copy == pieces[i].copy) ++end;
      WriteCopy(take, all.subspan(i, end - i), file);
    } else {
      WritePair(take, pieces[i], shapes[pieces[i].shape], file);
    }
    i = end;
  }
  for (std::size_t object = 0; object < take.objects.size(); ++object) file << Object(take, object);
  file << "}\n";
  file.close();
  if (!file) return absl::UnavailableError(fmt::format("{}: cannot be written; is the disk full?", path.string()));
  return absl::OkStatus();
}

}  // namespace vorocast::interchange
