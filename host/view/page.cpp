// SPDX-License-Identifier: Apache-2.0
#include "view/page.hpp"

#include "view/page_sources.hpp"

namespace raysplats::view {
namespace {

std::string type_of(std::string_view name) {
  if (name.ends_with(".js")) return "text/javascript; charset=utf-8";
  if (name.ends_with(".css")) return "text/css; charset=utf-8";
  if (name.ends_with(".svg")) return "image/svg+xml";
  return "text/html; charset=utf-8";
}

}  // namespace

std::optional<PageFile> page_file(std::string_view path) {
  const std::string name(path == "/" ? "index.html" : path.substr(path.empty() ? 0 : 1));
  const auto found = page_sources().find(name);
  if (found == page_sources().end()) return std::nullopt;
  return PageFile{type_of(name), found->second};
}

}  // namespace raysplats::view
