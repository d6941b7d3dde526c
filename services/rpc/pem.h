// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>

#include "services/base/status.h"

namespace vorocast::rpc {

/// Checks that a file holds at least one certificate. NOT_FOUND or INVALID_ARGUMENT with the flag and the file.
absl::Status CheckCertificates(const std::string& flag, const std::string& file);
/// Checks that a certificate and a private key belong together.
absl::Status CheckKeyPair(const std::string& certificate_flag, const std::string& certificate, const std::string& key_flag, const std::string& key);

}  // namespace vorocast::rpc
