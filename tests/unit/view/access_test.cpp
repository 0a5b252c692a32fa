// SPDX-License-Identifier: Apache-2.0
#include "view/access.hpp"

#include <arpa/inet.h>
#include <doctest/doctest.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <string>
#include <vector>

#include "view/own_addresses.hpp"

using namespace raysplats::view;

TEST_CASE("only our own page, asked for under our own name with the secret, is let in") {
  const std::string token = "0123456789abcdef0123456789abcdef";
  const Access access(token, {"127.0.0.1"}, 7000);
  const std::string query = "token=" + token;
  const std::string cookie = "a=b; raysplats-7000=" + token;
  const auto judge = [&](std::string_view host, std::string_view origin, std::string_view sent,
                         std::string_view asked) {
    return access.judge({host, origin, sent, asked});
  };
  for (const char* host : {"127.0.0.1:7000", "localhost:7000", "[::1]:7000"}) {
    INFO(host);
    CHECK(judge(host, "", cookie, "") == Verdict::kAllowed);
    CHECK(judge(host, "", "", query) == Verdict::kTakeCookie);
    CHECK(judge(host, std::string("http://") + host, cookie, "") == Verdict::kAllowed);
    CHECK(judge(host, "", "", "") == Verdict::kForbidden);
  }
  // Names that resolve to us, other ports, and names that only contain ours.
  for (const char* host : {"", "evil.example:7000", "127.0.0.1", "127.0.0.1:7001",
                           "127.0.0.1:7000.evil.example", "localhost:70000"}) {
    INFO(host);
    CHECK(judge(host, "", cookie, query) == Verdict::kForbidden);
  }
  for (const char* origin : {"null", "http://evil.example", "https://127.0.0.1:7000",
                             "http://127.0.0.1:7000.evil.example", "http://localhost:7000"}) {
    INFO(origin);
    CHECK(judge("127.0.0.1:7000", origin, cookie, query) == Verdict::kForbidden);
  }
  // Wrong secrets: shorter, longer, empty, of another port, of another name.
  for (const std::string& wrong :
       {token.substr(1), token + "0", std::string(), std::string(32, '0')}) {
    CHECK(judge("127.0.0.1:7000", "", "raysplats-7000=" + wrong, "") == Verdict::kForbidden);
    CHECK(judge("127.0.0.1:7000", "", "", "token=" + wrong) == Verdict::kForbidden);
  }
  CHECK(judge("127.0.0.1:7000", "", "raysplats-7001=" + token, "") == Verdict::kForbidden);
  CHECK(judge("127.0.0.1:7000", "", "", "nottoken=" + token) == Verdict::kForbidden);
  CHECK(judge("127.0.0.1:7000", "", "", "a=b&token=" + token) == Verdict::kTakeCookie);
  CHECK(access.urls() == std::vector{"http://127.0.0.1:7000/?token=" + token});
  CHECK(access.cookie().find("HttpOnly; SameSite=Lax") != std::string::npos);
}

TEST_CASE("all addresses that reach the server are names of it, and no other is") {
  const std::string token = "0123456789abcdef0123456789abcdef";
  const std::string query = "token=" + token;
  const Access access(token, {"192.0.2.7", "2001:db8::7"}, 7000);
  CHECK(access.urls() == std::vector{"http://192.0.2.7:7000/?token=" + token,
                                     "http://[2001:db8::7]:7000/?token=" + token});
  for (const char* host : {"192.0.2.7:7000", "[2001:db8::7]:7000", "localhost:7000"}) {
    INFO(host);
    CHECK(access.judge({host, "", "", query}) == Verdict::kTakeCookie);
    CHECK(access.judge({host, std::string("http://") + host, "", query}) == Verdict::kTakeCookie);
    CHECK(access.judge({host, "http://192.0.2.8:7000", "", query}) == Verdict::kForbidden);
  }
  for (const char* host : {"192.0.2.7", "192.0.2.8:7000", "2001:db8::7:7000", "0.0.0.0:7000"}) {
    INFO(host);
    CHECK(access.judge({host, "", "", query}) == Verdict::kForbidden);
  }
}

TEST_CASE("the port of HTTP may be left out, as browsers do") {
  const std::string token = "0123456789abcdef0123456789abcdef";
  const std::string query = "token=" + token;
  const Access access(token, {"127.0.0.1"}, 80);
  for (const char* host : {"127.0.0.1", "localhost", "[::1]", "127.0.0.1:80"}) {
    INFO(host);
    CHECK(access.judge({host, "", "", query}) == Verdict::kTakeCookie);
    CHECK(access.judge({host, std::string("http://") + host, "", query}) == Verdict::kTakeCookie);
  }
  CHECK(access.judge({"localhost:8080", "", "", query}) == Verdict::kForbidden);
  CHECK(access.judge({"evil.example", "", "", query}) == Verdict::kForbidden);
}

TEST_CASE("this machine has a loopback address, which comes first") {
  const std::vector<std::string> addresses = own_addresses(false);
  REQUIRE(!addresses.empty());
  CHECK(addresses.front().starts_with("127."));
  for (const std::string& each : addresses) CHECK(each.find(':') == std::string::npos);
  const std::vector<std::string> all = own_addresses(true);
  for (const std::string& each : addresses) CHECK(std::count(all.begin(), all.end(), each) == 1);
}

TEST_CASE("a machine whose interfaces are all down has the loopback's address all the same") {
  CHECK(addresses_of(nullptr, false) == std::vector<std::string>{"127.0.0.1"});
  CHECK(addresses_of(nullptr, true) == std::vector<std::string>{"127.0.0.1"});
  sockaddr_in number{};
  number.sin_family = AF_INET;
  number.sin_addr.s_addr = htonl(0xc0000207);  // 192.0.2.7
  ifaddrs card{};
  card.ifa_addr = reinterpret_cast<sockaddr*>(&number);
  CHECK(addresses_of(&card, true) == std::vector<std::string>{"127.0.0.1"});
  card.ifa_flags = IFF_UP;
  CHECK(addresses_of(&card, true) == std::vector<std::string>{"192.0.2.7"});
}

TEST_CASE("tokens are random and secrets are compared whole") {
  const std::string one = random_token();
  CHECK(one.size() == 32);
  CHECK(one != random_token());
  CHECK(one.find_first_not_of("0123456789abcdef") == std::string::npos);
  CHECK(equal_secrets("abc", "abc"));
  CHECK(!equal_secrets("abc", "abd"));
  CHECK(!equal_secrets("abc", "ab"));
  CHECK(equal_secrets("", ""));
}
