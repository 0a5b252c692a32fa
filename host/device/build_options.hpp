// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>
#include <map>
#include <string>
#include <type_traits>

namespace raysplats {

/// Preprocessor definitions a kernel is specialised by and the language it is written in; their
/// text is part of every cache key.
class BuildOptions {
 public:
  template <class T>
  BuildOptions& define(const std::string& name, const T& value) {
    if constexpr (std::is_same_v<T, float>)
      values_[name] = fmt::format("{:.9e}f", value);
    else
      values_[name] = fmt::format("{}", value);
    return *this;
  }
  /// A later OpenCL C than 1.2, "CL3.0", where what the device has is part of that only.
  BuildOptions& language(const std::string& version) {
    language_ = version;
    return *this;
  }
  /// "-cl-std=CL1.2 -D A=1 -D B=2", sorted by name.
  std::string text() const {
    std::string out = "-cl-std=" + language_;
    for (const auto& [name, value] : values_) out += fmt::format(" -D {}={}", name, value);
    return out;
  }

 private:
  std::string language_ = "CL1.2";
  std::map<std::string, std::string> values_;
};

}  // namespace raysplats
