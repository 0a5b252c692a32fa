// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace raysplats::report {

/// Text as it stands in XML, attributes included: &, <, > and quotes escaped, control characters
/// and bytes that are no UTF-8 replaced.
std::string escaped(std::string_view text);

/// Bytes as a data: address.
std::string data_url(std::string_view type, std::span<const unsigned char> bytes);

/// A cell of a table: a share, 0 .. 1, as a bar and a number; empty for none.
std::string share_cell(double share);

/// A whole page: well-formed XML, no scripts, nothing from elsewhere, light and dark. `title` is
/// escaped here, `body` has been.
std::string page(std::string_view title, std::string_view body);

/// Colours of curves and of headings, in classes c0, c1, ...; further ones begin again.
constexpr std::size_t kColors = 6;

}  // namespace raysplats::report
