// SPDX-License-Identifier: AGPL-3.0-or-later
// The files open in h5py, with the names, shapes and types of docs/storage_format.md.
#include <array>
#include <cstdio>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include "services/storage/hdf5_artifacts.h"
#include "tests/unit/services/storage/sample_takes.h"
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::storage {
namespace {

using ::testing::HasSubstr;

/// What Python prints; standard error is part of it.
std::string RunPython(const std::filesystem::path& script) {
  std::string output;
  FILE* pipe = ::popen(("/usr/bin/python3 " + script.string() + " 2>&1").c_str(), "r");
  if (!pipe) return "no shell";
  std::array<char, 4096> block;
  while (const std::size_t count = std::fread(block.data(), 1, block.size(), pipe)) output.append(block.data(), count);
  ::pclose(pipe);
  return output;
}

constexpr char kListing[] = R"(
import sys
try:
    import h5py
except ImportError:
    print('no h5py')
    sys.exit()
import os
folder = os.path.dirname(os.path.abspath(__file__))
for name in ('tracked.h5', 'simulated.h5'):
    with h5py.File(os.path.join(folder, name), 'r') as file:
        file.visititems(lambda path, item: print(name, path, item.shape, item.dtype) if isinstance(item, h5py.Dataset) else None)
        print(name, 'kind', file.attrs['kind'], 'inputs', list(file.attrs['inputs']), 'seed', int(file.attrs['seed']))
with h5py.File(os.path.join(folder, 'tracked.h5'), 'r') as file:
    print('frame', file['template'].attrs['frame'], 'x', file['cells/translation'][2, 1, 0], 'fps', file.attrs['frames_per_second'])
)";

TEST(H5py, ReadsTheFilesAsTheFormatSays) {
  const TemporaryFolder folder;
  ASSERT_EQ(WriteTrackedTake(folder / "tracked.h5", ThreeCubesTracked(), SomeProvenance()), absl::OkStatus());
  ASSERT_EQ(WriteSimulatedTake(folder / "simulated.h5", TwoCubesAndABall(), SomeProvenance()), absl::OkStatus());
  std::ofstream(folder / "listing.py") << kListing;
  const std::string output = RunPython(folder / "listing.py");
  if (output.find("no h5py") != std::string::npos || output.find("not found") != std::string::npos) GTEST_SKIP() << "h5py is not installed";
  for (const char* line : {
           "tracked.h5 template/sites (3, 3) float64",
           "tracked.h5 template/cells/volume (3,) float64",
           "tracked.h5 template/cells/centroid (3, 3) float64",
           "tracked.h5 template/cells/boundary (3,) uint8",
           "tracked.h5 template/cells/depth (3,) float64",
           "tracked.h5 template/cells/component (3,) int32",
           "tracked.h5 template/cells/face_offset (4,) int64",
           "tracked.h5 template/faces/vertex_offset (19,) int64",
           "tracked.h5 template/faces/vertex (72,) int32",
           "tracked.h5 template/faces/neighbour (18,) int32",
           "tracked.h5 template/vertices (16, 3) float64",
           "tracked.h5 template/surface/points (3, 3) float64",
           "tracked.h5 template/surface/normals (3, 3) float32",
           "tracked.h5 template/surface/colours (3, 3) uint8",
           "tracked.h5 template/patch (3,) int32",
           "tracked.h5 frames (3,) int32",
           "tracked.h5 frame_state (3,) uint8",
           "tracked.h5 frame_residual (3,) float64",
           "tracked.h5 frame_confidence (3,) float64",
           "tracked.h5 patches/rotation (3, 2, 4) float64",
           "tracked.h5 patches/translation (3, 2, 3) float64",
           "tracked.h5 cells/rotation (3, 3, 4) float32",
           "tracked.h5 cells/translation (3, 3, 3) float32",
           "simulated.h5 time (2,) float64",
           "simulated.h5 cells/rotation (2, 2, 4) float32",
           "simulated.h5 cells/translation (2, 2, 3) float32",
           "simulated.h5 cells/state (2, 2) uint8",
           "simulated.h5 objects/name (2,) |S10",
           "simulated.h5 objects/vertex_offset (3,) int64",
           "simulated.h5 objects/vertices (7, 3) float64",
           "simulated.h5 objects/triangle_offset (3,) int64",
           "simulated.h5 objects/triangles (5, 3) int32",
           "simulated.h5 objects/rotation (2, 2, 4) float64",
           "simulated.h5 objects/translation (2, 2, 3) float64",
           "seed 18446744073709551615",
           "frame 12 x 1.75 fps 50.0",  // frame 2, cell 1 is entry 7: 0.25 * 7
       }) {
    EXPECT_THAT(output, HasSubstr(line));
  }
}

}  // namespace
}  // namespace vorocast::storage
