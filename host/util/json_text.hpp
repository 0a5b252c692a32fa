// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace raysplats {

/// The text of an nlohmann::json, or ordered_json, that is written or sent. Names of files, words
/// of command lines and what drivers say are any bytes: what is no UTF-8 in them becomes U+FFFD.
/// `indent`: as of dump().
template <class Json>
std::string json_text(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace raysplats
