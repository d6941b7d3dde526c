// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/hdf5_handles.h"

#include <algorithm>

namespace vorocast::storage {
namespace {

/// H5Ewalk2 visits the stack from its innermost entry; the first two say what happened and what it was part of.
herr_t CollectCause(unsigned depth, const H5E_error2_t* error, void* text) {
  if (depth >= 2 || !error->desc || !*error->desc) return 0;
  auto& causes = *static_cast<std::string*>(text);
  if (!causes.empty()) causes += "; ";
  causes += error->desc;
  return 0;
}

}  // namespace

void SilenceHdf5() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

std::string Hdf5Error() {
  std::string causes;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, CollectCause, &causes);
  return causes.empty() ? "HDF5 gives no reason" : "HDF5: " + causes;
}

Hdf5Id FixedStringType(std::size_t bytes) {
  Hdf5Id type(H5Tcopy(H5T_C_S1));
  H5Tset_size(type.get(), std::max<std::size_t>(bytes, 1));
  H5Tset_cset(type.get(), H5T_CSET_UTF8);
  H5Tset_strpad(type.get(), H5T_STR_NULLPAD);
  return type;
}

}  // namespace vorocast::storage
