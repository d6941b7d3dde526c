// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/palette.h"

#include <cmath>

namespace vorocast::synth {
namespace {

constexpr geometry::Rgb8 kSkin = {226, 172, 142};
constexpr geometry::Rgb8 kLips = {186, 84, 88};
constexpr geometry::Rgb8 kEyes = {52, 46, 58};
constexpr geometry::Rgb8 kHair = {72, 44, 34};
constexpr geometry::Rgb8 kBodice = {38, 70, 120};
constexpr geometry::Rgb8 kSash = {222, 176, 82};
constexpr geometry::Rgb8 kStockings = {62, 60, 84};
constexpr geometry::Rgb8 kShoes = {120, 40, 48};
constexpr geometry::Rgb8 kSkirt = {178, 44, 62};
constexpr geometry::Rgb8 kHem = {232, 190, 110};
constexpr geometry::Rgb8 kCage = {206, 160, 72};
constexpr geometry::Rgb8 kBird = {70, 160, 190};

geometry::Rgb8 Face(const geometry::Vec3& x) {
  if (x.z() < 0.05) return kSkin;
  if (std::hypot(std::abs(x.x()) - 0.031, (x.y() - 1.655) * 1.6) < 0.012) return kEyes;
  if (std::hypot(x.x(), (x.y() - 1.586) * 2.8) < 0.020) return kLips;
  return kSkin;
}

}  // namespace

geometry::Rgb8 ColourOf(Part part, const geometry::Vec3& at_rest) {
  switch (part) {
    case Part::kHead:
      return Face(at_rest);
    case Part::kHair:
      return kHair;
    case Part::kTorso:
      return at_rest.y() > 1.05 && at_rest.y() < 1.10 ? kSash : kBodice;
    case Part::kLeftArm:
    case Part::kRightArm:
      return std::abs(at_rest.x()) < 0.30 ? kBodice : kSkin;
    case Part::kLeftLeg:
    case Part::kRightLeg:
      return kStockings;
    case Part::kShoes:
      return kShoes;
    case Part::kSkirt:
      return at_rest.y() < 0.045 ? kHem : kSkirt;  // a skirt's rest place is its height above the hem
    case Part::kCage:
      // A cage's rest place is measured from the middle of its floor; the bird sits in the middle.
      return std::hypot(at_rest.x(), at_rest.z()) < 0.095 && at_rest.y() > 0.06 && at_rest.y() < 0.23 ? kBird : kCage;
  }
  return kSkin;
}

}  // namespace vorocast::synth
