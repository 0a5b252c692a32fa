// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>
#include <map>
#include <string>

namespace raysplats {

/// Preprocessor definitions a kernel is specialised by; their sorted text is part of every cache
/// key.
class BuildOptions {
 public:
  template <class T>
  BuildOptions& define(const std::string& name, const T& value) {
    values_[name] = fmt::format("{}", value);
    return *this;
  }
  /// "-D A=1 -D B=2", sorted by name.
  std::string text() const {
    std::string out;
    for (const auto& [name, value] : values_) {
      out += fmt::format("{}-D {}={}", out.empty() ? "" : " ", name, value);
    }
    return out;
  }

 private:
  std::map<std::string, std::string> values_;
};

}  // namespace raysplats
