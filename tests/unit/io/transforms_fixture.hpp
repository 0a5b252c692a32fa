// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "raysplats/io.hpp"
#include "unit/io/data_sets.hpp"

namespace raysplats::test {

/// A frame of a camera file: the photo `file` seen from (x, 2, 3), with more keys.
inline std::string frame(const std::string& file, double x, const std::string& more = "") {
  return "{\"file_path\": \"" + file + "\", " + more + "\"transform_matrix\": " + matrix_json(x) +
         "}";
}

inline std::string file_of(const std::string& keys, const std::string& frames) {
  return std::string("{").append(keys).append("\"frames\": [").append(frames).append("]}");
}

inline std::vector<Camera> cameras_of(const std::string& json) {
  const Scratch scratch;
  write_bytes(scratch / "cameras.json", json);
  return read_cameras(scratch / "cameras.json");
}

/// What the error says with which this camera file is refused; "" when it is read.
inline std::string cameras_error(const std::string& json) {
  const Scratch scratch;
  write_bytes(scratch / "cameras.json", json);
  const std::string message = data_error([&] { read_cameras(scratch / "cameras.json"); });
  INFO(message);
  CHECK((message.empty() || contains(message, "cameras.json")));
  CHECK(message.find('\n') == std::string::npos);
  return message;
}

}  // namespace raysplats::test
