// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

struct ifaddrs;

namespace raysplats::view {

/// The IPv4 addresses of this machine's interfaces that are up, with `ipv6` their IPv6 addresses
/// too, those of the loopback first: what reaches a server that listens on all interfaces.
/// Throws Error when the system does not tell them.
std::vector<std::string> own_addresses(bool ipv6);

/// The same of a list of interfaces, which may be null; 127.0.0.1 where none of them has one.
std::vector<std::string> addresses_of(const ifaddrs* interfaces, bool ipv6);

}  // namespace raysplats::view
