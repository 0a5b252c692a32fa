// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace raysplats::io {

/// Whether a URI holds its content itself (RFC 2397) rather than naming a file.
bool is_data_uri(std::string_view uri);

/// The content of such a URI, of any media type, in base64 or percent-encoded; none where it is
/// malformed.
std::optional<std::vector<unsigned char>> decode_data_uri(std::string_view uri);

/// A part of a URI with every %41 as the byte that it stands for; a % without two hexadecimal
/// digits stays.
std::string percent_decoded(std::string_view text);

}  // namespace raysplats::io
