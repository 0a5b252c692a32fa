// SPDX-License-Identifier: Apache-2.0
#include "io/data_uri.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>

#include "util/ascii.hpp"

namespace raysplats::io {
namespace {

constexpr std::string_view kScheme = "data:";
constexpr std::string_view kBase64 = ";base64";

/// Schemes and the mark of base64 may be written in capitals.
bool is_same(std::string_view text, std::string_view lower_case) {
  return std::equal(text.begin(), text.end(), lower_case.begin(), lower_case.end(),
                    [&](char a, char b) { return ascii_lower(a) == b; });
}

/// The value of a digit (RFC 4648, section 4); -1 of what is none.
int digit_of(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+') return 62;
  return c == '/' ? 63 : -1;
}

std::optional<std::vector<unsigned char>> from_base64(std::string_view text) {
  while (text.ends_with('=')) text.remove_suffix(1);
  if (text.size() % 4 == 1) return std::nullopt;
  std::vector<unsigned char> bytes;
  bytes.reserve(text.size() / 4 * 3 + 2);
  std::uint32_t bits = 0;
  int count = 0;  // of bits that are in no byte yet
  for (const char c : text) {
    const int digit = digit_of(c);
    if (digit < 0) return std::nullopt;
    bits = bits << 6 | static_cast<std::uint32_t>(digit);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes.push_back(static_cast<unsigned char>(bits >> count));
  }
  return bytes;
}

}  // namespace

bool is_data_uri(std::string_view uri) { return is_same(uri.substr(0, kScheme.size()), kScheme); }

std::optional<std::vector<unsigned char>> decode_data_uri(std::string_view uri) {
  const std::size_t comma = uri.find(',');
  if (!is_data_uri(uri) || comma == std::string_view::npos) return std::nullopt;
  const std::string_view type = uri.substr(0, comma);
  const std::string decoded = percent_decoded(uri.substr(comma + 1));
  if (is_same(type.substr(type.size() - std::min(type.size(), kBase64.size())), kBase64)) {
    return from_base64(decoded);
  }
  return std::vector<unsigned char>(decoded.begin(), decoded.end());
}

std::string percent_decoded(std::string_view text) {
  std::string decoded;
  decoded.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned byte = 0;
    const char* digits = text.data() + i + 1;
    if (text[i] == '%' && text.size() - i > 2 &&
        std::from_chars(digits, digits + 2, byte, 16).ptr == digits + 2) {
      decoded += static_cast<char>(byte);
      i += 2;
    } else {
      decoded += text[i];
    }
  }
  return decoded;
}

}  // namespace raysplats::io
