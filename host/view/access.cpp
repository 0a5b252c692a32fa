// SPDX-License-Identifier: Apache-2.0
#include "view/access.hpp"

#include <fmt/format.h>
#include <sys/random.h>

#include <algorithm>
#include <array>

#include "raysplats/error.hpp"

namespace raysplats::view {
namespace {

constexpr std::uint16_t kHttpPort = 80;

/// The value of `name` in a list such as "a=1; b=2", "" when it is not there.
std::string_view value_in(std::string_view list, std::string_view name, char separator) {
  while (!list.empty()) {
    const std::size_t end = std::min(list.find(separator), list.size());
    std::string_view part = list.substr(0, end);
    list.remove_prefix(std::min(end + 1, list.size()));
    while (!part.empty() && part.front() == ' ') part.remove_prefix(1);
    if (part.starts_with(name) && part.size() > name.size() && part[name.size()] == '=')
      return part.substr(name.size() + 1);
  }
  return {};
}

}  // namespace

std::string random_token() {
  std::array<unsigned char, 16> bytes;
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw Error(ErrorCode::kRuntime, "The system gives no random numbers for the viewer's token");
  }
  std::string token;
  for (const unsigned char byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

bool equal_secrets(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    difference |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  return difference == 0;
}

Access::Access(std::string token, const std::vector<std::string>& addresses, std::uint16_t port)
    : token_(std::move(token)), cookie_name_(fmt::format("raysplats-{}", port)) {
  std::vector<std::string> names;
  for (const std::string& address : addresses) {
    // One of IPv6 stands in brackets.
    names.push_back(address.find(':') == std::string::npos ? address
                                                           : fmt::format("[{}]", address));
    urls_.push_back(fmt::format("http://{}:{}/?token={}", names.back(), port, token_));
  }
  names.insert(names.end(), {"127.0.0.1", "localhost", "[::1]"});
  for (const std::string& name : names) {
    hosts_.push_back(fmt::format("{}:{}", name, port));
    // Browsers leave out the port that HTTP has anyway.
    if (port == kHttpPort) hosts_.push_back(name);
  }
}

Verdict Access::judge(const Credentials& credentials) const {
  if (std::find(hosts_.begin(), hosts_.end(), credentials.host) == hosts_.end())
    return Verdict::kForbidden;
  if (!credentials.origin.empty() &&
      credentials.origin != fmt::format("http://{}", credentials.host)) {
    return Verdict::kForbidden;
  }
  if (equal_secrets(value_in(credentials.cookie, cookie_name_, ';'), token_))
    return Verdict::kAllowed;
  if (equal_secrets(value_in(credentials.query, "token", '&'), token_)) return Verdict::kTakeCookie;
  return Verdict::kForbidden;
}

// Lax: with Strict no browser sends it along the redirection that takes the token off the address,
// where the address is a link on another page. What other pages may do with it is GET and HEAD
// alone, which change nothing.
std::string Access::cookie() const {
  return fmt::format("{}={}; HttpOnly; SameSite=Lax; Path=/", cookie_name_, token_);
}

}  // namespace raysplats::view
