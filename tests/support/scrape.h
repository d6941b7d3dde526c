// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <map>
#include <string>

namespace vorocast::support {

/// GET http://ADDRESS/metrics over a plain socket, read as Prometheus's text format: each sample's value by name and labels as they are written.
/// Fails the test, and returns nothing, for any answer that is not 200 or a line that is no sample.
std::map<std::string, double> Scrape(const std::string& address);

}  // namespace vorocast::support
