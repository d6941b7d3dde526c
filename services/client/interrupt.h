// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

namespace vorocast::client {

/// From now on SIGINT and SIGTERM are remembered instead of ending the process; a second one ends it at once.
void CatchInterrupts();
bool Interrupted();

}  // namespace vorocast::client
