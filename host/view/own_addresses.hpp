// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace raysplats::view {

/// The IPv4 addresses of this machine's interfaces that are up, with `ipv6` their IPv6 addresses
/// too, those of the loopback first: what reaches a server that listens on all interfaces.
/// Throws Error when the system does not tell them.
std::vector<std::string> own_addresses(bool ipv6);

}  // namespace raysplats::view
