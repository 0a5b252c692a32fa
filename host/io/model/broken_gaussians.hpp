// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <set>
#include <string>

#include "raysplats/gaussians.hpp"

namespace raysplats::io {

/// Gaussians of a file with numbers that are not finite.
class BrokenGaussians {
 public:
  /// `name`: of the number.
  void add(std::size_t gaussian, const std::string& name);

  /// Takes them out of the model with a warning. Without `drop` throws DataError that counts them
  /// and says how they are left out, and with it DataError when no other is left. Does nothing
  /// where there are none.
  void settle(Gaussians& model, const std::filesystem::path& path, bool drop) const;

 private:
  std::set<std::size_t> numbers_;
  std::string first_name_;
};

}  // namespace raysplats::io
