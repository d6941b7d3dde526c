// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/collection_policy.h"

#include <algorithm>
#include <tuple>

namespace vorocast::server {

CollectionPlan PlanCollection(std::vector<storage::StoredFile> files, const InUse& in_use, const CollectionPolicy& policy, absl::Time now) {
  CollectionPlan plan;
  for (const storage::StoredFile& file : files) plan.bytes_before += file.size;
  std::erase_if(files, [&](const storage::StoredFile& file) {
    const bool needed = (file.what == storage::StoredFile::What::kBlob ? in_use.blobs : in_use.results).contains(file.digest);
    if (needed) plan.bytes_in_use += file.size;
    return needed || now - file.used < policy.keep_at_least;
  });
  std::sort(files.begin(), files.end(), [](const storage::StoredFile& a, const storage::StoredFile& b) {
    return std::tie(a.used, a.digest, a.extension) < std::tie(b.used, b.digest, b.extension);
  });
  for (storage::StoredFile& file : files) {
    const bool old = now - file.used >= policy.keep;
    const bool too_much = policy.disk_limit > 0 && plan.bytes_before - plan.bytes > policy.disk_limit;
    if (!old && !too_much) break;
    plan.bytes += file.size;
    plan.remove.push_back({std::move(file), old ? Collected::Why::kOld : Collected::Why::kLimit});
  }
  return plan;
}

}  // namespace vorocast::server
