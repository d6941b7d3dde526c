// SPDX-License-Identifier: AGPL-3.0-or-later
// Artifacts that are whole HDF5 files with wrong contents: values, shapes, types, links and attributes are changed through the HDF5 library itself.
// An input's first byte says which of the small artifacts, every eight bytes after it are one change.
#include "services/base/random.h"
#include "tests/fuzz/artifact_edit.h"
#include "tests/fuzz/artifact_files.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {

const Subject kSubject = {.form = Form::kBytes};

std::vector<std::string> MadeInputs() {
  std::vector<std::string> inputs;
  for (std::size_t file = 0; file < SmallArtifacts().size(); ++file) {
    inputs.emplace_back(1, static_cast<char>(file));
    base::Random random(file);
    for (int i = 0; i < 40; ++i) {
      inputs.push_back(inputs[inputs.size() - 1].substr(0, 1));
      for (std::size_t byte = 0; byte < kArtifactEditBytes; ++byte) inputs.back().push_back(static_cast<char>(random.Bits()));
    }
  }
  return inputs;
}

}  // namespace vorocast::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace vorocast;
  const std::string_view input = fuzz::View(bytes, size);
  if (input.empty()) return 0;
  const auto& files = fuzz::SmallArtifacts();
  const std::string& file = files[bytes[0] % files.size()];
  const auto path = fuzz::ArtifactFolder().Write("input.h5", file);
  fuzz::EditArtifact(path, input.substr(1));
  fuzz::ReadEveryWay(path);
  return 0;
}
