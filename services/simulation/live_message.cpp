// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/live_message.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>
#include <vector>

namespace vorocast::simulation {
namespace {

static_assert(std::endian::native == std::endian::little, "floats travel as they lie in memory");

template <typename T>
std::string Bytes(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

template <typename T>
bool Read(const std::string& bytes, std::size_t count, std::vector<T>& values) {
  if (bytes.size() != count * sizeof(T)) return false;
  values.resize(count);
  std::memcpy(values.data(), bytes.data(), bytes.size());
  return true;
}

}  // namespace

void Pack(const geometry::SimulatedTake& now, v1::LiveInstant& instant) {
  std::vector<float> rotation, translation;
  std::vector<double> objects;
  for (const Eigen::Vector4f& q : now.cell_rotation) rotation.insert(rotation.end(), q.data(), q.data() + 4);
  for (const geometry::Vec3& t : now.cell_translation) {
    for (int axis = 0; axis < 3; ++axis) translation.push_back(static_cast<float>(t[axis]));
  }
  for (const geometry::Rigid3& pose : now.object_pose) {
    const geometry::Quat& q = pose.rotation;
    const geometry::Vec3& t = pose.translation;
    objects.insert(objects.end(), {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()});
  }
  instant.set_time(now.time.back());
  instant.set_rotation(Bytes(rotation));
  instant.set_translation(Bytes(translation));
  instant.set_state(Bytes(now.cell_state));
  instant.set_scale(Bytes(now.cell_scale));
  instant.set_objects(Bytes(objects));
  instant.set_released(static_cast<std::int32_t>(std::ranges::count(now.cell_state, geometry::CellState::kReleased)));
  instant.set_cell_penetration_m(now.cell_penetration_m);
  instant.set_cell_overlap_m(now.cell_overlap_m);
  instant.set_object_penetration_m(now.object_penetration_m);
  instant.set_ground_penetration_m(now.ground_penetration_m);
}

absl::Status Unpack(const v1::LiveInstant& instant, std::size_t cells, std::size_t objects, geometry::SimulatedTake& take) {
  std::vector<float> rotation, translation, scale;
  std::vector<std::uint8_t> state;
  std::vector<double> poses;
  const bool fits = Read(instant.rotation(), 4 * cells, rotation) && Read(instant.translation(), 3 * cells, translation) &&
                    Read(instant.state(), cells, state) && Read(instant.objects(), 7 * objects, poses) &&
                    (instant.scale().empty() || Read(instant.scale(), cells, scale));
  if (!fits || std::ranges::any_of(state, [](std::uint8_t s) { return s > static_cast<std::uint8_t>(geometry::CellState::kGone); })) {
    return absl::DataLossError("a frame does not fit the take; is it the tracked.h5 that the service has under this key?");
  }
  // All instants have sizes, or none.
  if (!scale.empty() && take.cell_scale.empty()) take.cell_scale.assign(take.cell_rotation.size(), 1.0f);
  if (scale.empty() && !take.cell_scale.empty()) scale.assign(cells, 1.0f);
  take.cell_scale.insert(take.cell_scale.end(), scale.begin(), scale.end());
  take.time.push_back(instant.time());
  for (std::size_t c = 0; c < cells; ++c) {
    take.cell_rotation.emplace_back(rotation[4 * c], rotation[4 * c + 1], rotation[4 * c + 2], rotation[4 * c + 3]);
    take.cell_translation.emplace_back(translation[3 * c], translation[3 * c + 1], translation[3 * c + 2]);
    take.cell_state.push_back(static_cast<geometry::CellState>(state[c]));
  }
  for (std::size_t o = 0; o < objects; ++o) {
    const double* p = &poses[7 * o];
    take.object_pose.push_back({geometry::Quat(p[0], p[1], p[2], p[3]), geometry::Vec3(p[4], p[5], p[6])});
  }
  take.cell_penetration_m = instant.cell_penetration_m();
  take.cell_overlap_m = instant.cell_overlap_m();
  take.object_penetration_m = instant.object_penetration_m();
  take.ground_penetration_m = instant.ground_penetration_m();
  return absl::OkStatus();
}

void Truncate(std::size_t instants, std::size_t cells, std::size_t objects, geometry::SimulatedTake& take) {
  if (instants >= take.time.size()) return;
  const auto shorten = [](auto& values, std::size_t size) { values.erase(values.begin() + static_cast<std::ptrdiff_t>(size), values.end()); };
  shorten(take.time, instants);
  shorten(take.cell_rotation, instants * cells);
  shorten(take.cell_translation, instants * cells);
  shorten(take.cell_state, instants * cells);
  if (!take.cell_scale.empty()) shorten(take.cell_scale, instants * cells);
  shorten(take.object_pose, instants * objects);
}

}  // namespace vorocast::simulation
