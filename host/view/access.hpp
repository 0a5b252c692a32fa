// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

/// Who may talk to the viewer. Any page that is open in a browser of this machine can send requests
/// to a local port, under any host name that resolves to it, so that host, origin and a secret are
/// all checked.
namespace raysplats::view {

/// 128 random bits as 32 hexadecimal digits. Throws Error when the system gives none.
std::string random_token();

/// What of a request decides. Empty where the request has no such header.
struct Credentials {
  std::string_view host;
  std::string_view origin;
  std::string_view cookie;
  std::string_view query;  ///< behind the '?' of the target
};

enum class Verdict {
  kAllowed,
  kTakeCookie,  ///< allowed by the token of the URL, which a cookie should replace
  kForbidden,
};

class Access {
 public:
  /// `addresses` reach the server, beside the names of this machine itself.
  Access(std::string token, const std::vector<std::string>& addresses, std::uint16_t port);

  /// Forbidden: another host than ours, an origin other than our own page (none is allowed, as the
  /// token is known then), neither the token nor the cookie.
  Verdict judge(const Credentials& credentials) const;
  /// The value of the Set-Cookie header.
  std::string cookie() const;
  /// What to open first, one for each of the addresses.
  const std::vector<std::string>& urls() const { return urls_; }

 private:
  std::string token_;
  std::string cookie_name_;
  std::vector<std::string> hosts_;  ///< as browsers write them: with the port
  std::vector<std::string> urls_;
};

/// Compares without telling by the time how much was right.
bool equal_secrets(std::string_view a, std::string_view b);

}  // namespace raysplats::view
