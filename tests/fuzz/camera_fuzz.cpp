// SPDX-License-Identifier: AGPL-3.0-or-later
// A film's camera.
#include <nlohmann/json.hpp>

#include "services/rendering/film_camera.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {

const Subject kSubject = {.form = Form::kJson};
std::vector<std::string> MadeInputs() { return {VeryDeep(R"({"eye_m": )", "}")}; }

}  // namespace vorocast::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace vorocast;
  const auto json = nlohmann::json::parse(fuzz::View(bytes, size), nullptr, false);
  if (json.is_discarded()) return 0;
  const auto path = rendering::CameraPathFromJson(json);
  if (!path.ok()) return 0;
  for (const double seconds : {-1.0, 0.0, 0.3, 1e7}) {
    const auto camera = rendering::CameraAt(*path, seconds, 64, 48);
    fuzz::Require(camera.eye.allFinite() && camera.pixel > 0, "a camera that stands nowhere");
  }
  return 0;
}
