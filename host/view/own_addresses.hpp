// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace raysplats::view {

/// The addresses of this machine's interfaces that are up, those of the loopback first: what
/// reaches a server that listens on all of them. Of IPv4, and of IPv6 too where `ipv6` says so.
/// Throws Error when the system does not tell them.
std::vector<std::string> own_addresses(bool ipv6);

}  // namespace raysplats::view
