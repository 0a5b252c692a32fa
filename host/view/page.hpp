// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace raysplats::view {

struct PageFile {
  std::string type;  ///< Content-Type
  std::string content;
};

/// A file of host/view/page, which the library holds: "/" is index.html, others go by name; nothing
/// for any other path.
std::optional<PageFile> page_file(std::string_view path);

}  // namespace raysplats::view
