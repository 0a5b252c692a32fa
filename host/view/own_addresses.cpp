// SPDX-License-Identifier: Apache-2.0
#include "view/own_addresses.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <array>
#include <memory>

#include "raysplats/error.hpp"

namespace raysplats::view {
namespace {

/// "" for what browsers cannot open.
std::string text_of(const sockaddr& address, bool ipv6) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  const void* bytes = nullptr;
  if (address.sa_family == AF_INET) {
    bytes = &reinterpret_cast<const sockaddr_in&>(address).sin_addr;
  } else if (address.sa_family == AF_INET6 && ipv6) {
    const in6_addr& own = reinterpret_cast<const sockaddr_in6&>(address).sin6_addr;
    // Addresses of one link alone need its name, for which URLs have no place.
    if (!IN6_IS_ADDR_LINKLOCAL(&own)) bytes = &own;
  }
  if (bytes == nullptr) return {};
  return ::inet_ntop(address.sa_family, bytes, text.data(), text.size()) ? text.data() : "";
}

}  // namespace

std::vector<std::string> own_addresses(bool ipv6) {
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) {
    throw Error(ErrorCode::kRuntime,
                "The system does not tell its addresses: give one of them as --host");
  }
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> list(first, ::freeifaddrs);
  return addresses_of(list.get(), ipv6);
}

std::vector<std::string> addresses_of(const ifaddrs* interfaces, bool ipv6) {
  std::vector<std::string> loopback, others;
  for (const ifaddrs* each = interfaces; each != nullptr; each = each->ifa_next) {
    if (each->ifa_addr == nullptr || !(each->ifa_flags & IFF_UP)) continue;
    std::string text = text_of(*each->ifa_addr, ipv6);
    if (!text.empty()) (each->ifa_flags & IFF_LOOPBACK ? loopback : others).push_back(text);
  }
  loopback.insert(loopback.end(), others.begin(), others.end());
  // Without interfaces nobody reaches the server, until the loopback is up.
  if (loopback.empty()) loopback.emplace_back("127.0.0.1");
  return loopback;
}

}  // namespace raysplats::view
