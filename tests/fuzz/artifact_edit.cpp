// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/fuzz/artifact_edit.h"

#include <hdf5.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "services/base/random.h"
#include "tests/fuzz/mutate.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {
namespace {

constexpr std::size_t kEditsMax = 8;

/// What is closed at the end of a change, in reverse; failures of the library are no concern here, for what cannot be changed stays as it is.
class Opened {
 public:
  Opened() = default;
  ~Opened() {
    for (auto id = ids_.rbegin(); id != ids_.rend(); ++id) H5Idec_ref(*id);
  }
  Opened(const Opened&) = delete;
  Opened& operator=(const Opened&) = delete;
  hid_t operator()(hid_t id) {
    if (id >= 0) ids_.push_back(id);
    return id;
  }

 private:
  std::vector<hid_t> ids_;
};

struct Places {
  std::vector<std::string> datasets, groups;
};

herr_t NotePlace(hid_t file, const char* name, const H5L_info_t* link, void* places) {
  if (link->type != H5L_TYPE_HARD) return 0;
  Opened opened;
  const hid_t object = opened(H5Oopen(file, name, H5P_DEFAULT));
  auto* all = static_cast<Places*>(places);
  (H5Iget_type(object) == H5I_DATASET ? all->datasets : all->groups).emplace_back(name);
  return 0;
}

herr_t NoteName(hid_t, const char* name, const H5A_info_t*, void* names) {
  static_cast<std::vector<std::string>*>(names)->emplace_back(name);
  return 0;
}

template <typename T>
const T& OneOf(const std::vector<T>& values, base::Random& random) {
  return values[random.Below(values.size())];
}

/// Overwrites one element of a buffer of `type`.
void Spoil(std::vector<char>& values, hid_t type, base::Random& random) {
  const std::size_t width = H5Tget_size(type);
  if (width == 0 || values.size() < width) return;
  char* element = values.data() + width * random.Below(values.size() / width);
  const H5T_class_t kind = H5Tget_class(type);
  if (kind == H5T_STRING) {
    element[random.Below(width)] = static_cast<char>(random.Bits());
  } else if (kind == H5T_FLOAT && width == sizeof(double)) {
    const double value = AwkwardDouble(random);
    std::memcpy(element, &value, width);
  } else if (kind == H5T_FLOAT && width == sizeof(float)) {
    const auto value = static_cast<float>(AwkwardDouble(random));
    std::memcpy(element, &value, width);
  } else {
    const std::uint64_t value = random.Below(2) == 0 ? AwkwardInteger(random) : random.Below(8);
    std::memcpy(element, &value, std::min(width, sizeof(value)));
  }
}

hid_t OtherType(base::Random& random) {
  const std::vector<hid_t> types = {H5T_STD_I32BE,  H5T_STD_I32LE,  H5T_STD_I64LE, H5T_STD_U8LE,    H5T_IEEE_F32LE,
                                    H5T_IEEE_F64LE, H5T_IEEE_F64BE, H5T_C_S1,      H5T_STD_REF_OBJ, H5T_STD_B16LE};
  return OneOf(types, random);
}

hid_t VariableString(Opened& opened) {
  const hid_t type = opened(H5Tcopy(H5T_C_S1));
  H5Tset_size(type, H5T_VARIABLE);
  return type;
}

/// A shape that resembles `shape`, or a null or scalar space.
hid_t OtherSpace(std::vector<hsize_t> shape, Opened& opened, base::Random& random) {
  switch (random.Below(8)) {
    case 0:
      return opened(H5Screate(H5S_NULL));
    case 1:
      return opened(H5Screate(H5S_SCALAR));
    case 2:
      shape.push_back(random.Below(4));
      break;
    case 3:
      if (shape.size() > 1) shape.pop_back();
      break;
    default:
      break;
  }
  if (!shape.empty() && random.Below(4) != 0) {
    hsize_t& length = shape[random.Below(shape.size())];
    const hsize_t lengths[] = {0, 1, length + 1, length > 0 ? length - 1 : 0, 2 * length, hsize_t{1} << 31, hsize_t{1} << 40, hsize_t{1} << 62};
    length = lengths[random.Below(std::size(lengths))];
  }
  return opened(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr));
}

std::vector<hsize_t> Extent(hid_t space) {
  std::vector<hsize_t> shape(static_cast<std::size_t>(std::max(0, H5Sget_simple_extent_ndims(space))));
  H5Sget_simple_extent_dims(space, shape.data(), nullptr);
  return shape;
}

std::size_t Bytes(hid_t space, hid_t type) {
  constexpr std::size_t kBytesMax = 1 << 16;
  const hssize_t count = H5Sget_simple_extent_npoints(space);
  if (count < 0 || std::size_t(count) > kBytesMax) return 0;
  return std::size_t(count) * H5Tget_size(type);
}

void SpoilDataset(hid_t file, const std::string& name, base::Random& random) {
  Opened opened;
  const hid_t dataset = opened(H5Dopen2(file, name.c_str(), H5P_DEFAULT));
  const hid_t type = opened(H5Dget_type(dataset));
  std::vector<char> values(Bytes(opened(H5Dget_space(dataset)), type));
  if (values.empty() || H5Tis_variable_str(type) > 0 || H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) return;
  Spoil(values, type, random);
  H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
}

/// Another shape, type or layout under the same name, with the values that fit or none.
void RemakeDataset(hid_t file, const std::string& name, base::Random& random) {
  Opened opened;
  const hid_t dataset = opened(H5Dopen2(file, name.c_str(), H5P_DEFAULT));
  hid_t type = opened(H5Dget_type(dataset));
  const hid_t old_space = opened(H5Dget_space(dataset));
  const std::uint64_t what = random.Below(8);
  const hid_t space = what < 4 ? OtherSpace(Extent(old_space), opened, random) : old_space;
  if (what == 4 || what == 5) type = random.Below(4) == 0 ? VariableString(opened) : OtherType(random);
  const hid_t creation = opened(H5Pcreate(H5P_DATASET_CREATE));
  const std::vector<hsize_t> chunk(Extent(space).size(), 2);
  if (what == 6 && !chunk.empty()) H5Pset_chunk(creation, static_cast<int>(chunk.size()), chunk.data());
  if (what == 7) H5Pset_layout(creation, H5D_COMPACT);
  // Of what is never written no bytes are stored.
  const bool stored = Bytes(space, type) > 0 && random.Below(4) != 0;
  if (stored && what < 6) H5Pset_alloc_time(creation, H5D_ALLOC_TIME_EARLY);
  std::vector<char> values(Bytes(old_space, opened(H5Dget_type(dataset))));
  if (!values.empty()) H5Dread(dataset, opened(H5Dget_type(dataset)), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
  H5Ldelete(file, name.c_str(), H5P_DEFAULT);
  const hid_t made = opened(H5Dcreate2(file, name.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT));
  if (!stored || H5Tis_variable_str(type) > 0) return;
  // Repeated or cut off.
  std::vector<char> fitting(Bytes(space, type));
  for (std::size_t i = 0; i < fitting.size() && !values.empty(); ++i) fitting[i] = values[i % values.size()];
  H5Dwrite(made, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, fitting.data());
}

void Relink(hid_t file, const std::string& name, const Places& places, base::Random& random) {
  const std::string other = OneOf(random.Below(2) == 0 ? places.datasets : places.groups, random);
  H5Ldelete(file, name.c_str(), H5P_DEFAULT);
  switch (random.Below(6)) {
    case 0:
      return;
    case 1:
      H5Lcreate_soft(("/" + other).c_str(), file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      return;
    case 2:
      H5Lcreate_external("/dev/null", "/x", file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      return;
    case 3: {
      Opened opened;
      opened(H5Gcreate2(file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
      return;
    }
    default:
      H5Lcreate_hard(file, other.c_str(), file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      return;
  }
}

void ChangeAttribute(hid_t file, const std::string& owner, base::Random& random) {
  Opened opened;
  const hid_t object = opened(H5Oopen(file, owner.c_str(), H5P_DEFAULT));
  std::vector<std::string> names;
  hsize_t from = 0;
  H5Aiterate2(object, H5_INDEX_NAME, H5_ITER_INC, &from, NoteName, &names);
  if (names.empty()) return;
  const std::string name = OneOf(names, random);
  const hid_t attribute = opened(H5Aopen(object, name.c_str(), H5P_DEFAULT));
  hid_t type = opened(H5Aget_type(attribute));
  hid_t space = opened(H5Aget_space(attribute));
  std::vector<char> values(Bytes(space, type));
  const bool readable = !values.empty() && H5Tis_variable_str(type) == 0 && H5Aread(attribute, type, values.data()) >= 0;
  if (random.Below(2) == 0) {
    if (!readable) return;
    Spoil(values, type, random);
    H5Awrite(attribute, type, values.data());
    return;
  }
  H5Adelete(object, name.c_str());
  const std::uint64_t what = random.Below(4);
  if (what == 0) return;
  if (what == 1) type = random.Below(2) == 0 ? VariableString(opened) : OtherType(random);
  if (what > 1) space = OtherSpace(Extent(space), opened, random);
  const hid_t made = opened(H5Acreate2(object, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT));
  if (H5Tis_variable_str(type) > 0) return;
  values.resize(Bytes(space, type));
  if (!values.empty()) H5Awrite(made, type, values.data());
}

void EditOnce(hid_t file, base::Random& random) {
  Places places;
  H5Lvisit(file, H5_INDEX_NAME, H5_ITER_INC, NotePlace, &places);
  places.groups.emplace_back("/");
  if (places.datasets.empty()) return;
  const std::string name = OneOf(places.datasets, random);
  const std::uint64_t what = random.Below(10);
  if (what < 5) return SpoilDataset(file, name, random);
  if (what < 7) return RemakeDataset(file, name, random);
  if (what < 9) return ChangeAttribute(file, OneOf(places.groups, random), random);
  const std::string& link = random.Below(4) == 0 ? OneOf(places.groups, random) : name;
  if (link != "/") Relink(file, std::string(link), places, random);
}

}  // namespace

void EditArtifact(const std::filesystem::path& path, std::string_view edits) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  Opened opened;
  const hid_t file = opened(H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT));
  Require(file >= 0, "(a small artifact that the HDF5 library does not open)");
  for (std::size_t i = 0; i < kEditsMax && edits.size() >= kArtifactEditBytes; ++i) {
    std::uint64_t seed = 0;
    std::memcpy(&seed, edits.data(), sizeof(seed));
    static_assert(sizeof(seed) == kArtifactEditBytes);
    base::Random random(seed);
    EditOnce(file, random);
    edits.remove_prefix(kArtifactEditBytes);
  }
}

}  // namespace vorocast::fuzz
