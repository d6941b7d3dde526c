// SPDX-License-Identifier: AGPL-3.0-or-later
// An artist's meshes in glTF; the other formats are those of frames. An input's first line is the extension, the rest is the file.
#include "services/simulation/mesh_file.h"
#include "tests/fuzz/scratch_folder.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {

const Subject kSubject = {.form = Form::kText};

std::vector<std::string> MadeInputs() {
  // One triangle: three corners, three indices of two bytes.
  std::string buffer;
  for (const float x : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f}) buffer.append(reinterpret_cast<const char*>(&x), sizeof(x));
  buffer += std::string("\0\0\1\0\2\0\0\0", 8);
  const auto document = [&](const std::string& uri) {
    return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"scale":[1,-1,2],"children":[1]},)"
           R"({"mesh":0,"rotation":[0,0,0,1],"translation":[1,2,3]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],)"
           R"("buffers":[{"byteLength":44)" +
           uri +
           R"(}],"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],)"
           R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},)"
           R"({"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}]})";
  };
  std::string json = document("");
  while (json.size() % 4 != 0) json += ' ';
  const auto word = [](std::size_t value) {
    const auto number = static_cast<std::uint32_t>(value);
    return std::string(reinterpret_cast<const char*>(&number), sizeof(number));
  };
  const std::string binary = "glTF" + word(2) + word(12 + 8 + json.size() + 8 + buffer.size()) + word(json.size()) + "JSON" + json +
                             word(buffer.size()) + std::string("BIN\0", 4) + buffer;
  const std::string embedded = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIAAAA=";
  // Once bad: a buffer without bytes; indices of a type that is none; nodes that show one another 2^60 times.
  std::string no_bytes = binary;
  no_bytes.replace(no_bytes.find(R"("byteLength":44)"), 15, R"("byteLength": 0)");
  std::string signed_indices = binary;
  signed_indices.replace(signed_indices.find("5123"), 4, "5120");
  std::string doubling = R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[)";
  for (int i = 1; i <= 60; ++i) doubling += R"({"children":[)" + std::to_string(i) + "," + std::to_string(i) + "]},";
  return {".glb\n" + no_bytes, ".glb\n" + signed_indices, ".gltf\n" + doubling + "{}]}", ".glb\n" + binary,
          ".gltf\n" + document(R"(,"uri":"data:application/octet-stream;base64,)" + embedded + "\"")};
}

}  // namespace vorocast::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace vorocast;
  static const fuzz::ScratchFolder folder;
  const std::string_view input = fuzz::View(bytes, size);
  const std::size_t line = input.find('\n');
  const std::string_view extension = input.substr(0, line);
  if (line == std::string_view::npos || (extension != ".glb" && extension != ".gltf")) return 0;
  const auto mesh = simulation::ReadMeshFile(folder.Write("mesh" + std::string(extension), input.substr(line + 1)));
  if (!mesh.ok()) return 0;
  for (const auto& triangle : mesh->triangles) {
    for (const std::int32_t corner : triangle)
      fuzz::Require(corner >= 0 && std::size_t(corner) < mesh->vertices.size(), "a corner that is not there");
  }
  return 0;
}
