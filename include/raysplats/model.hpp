// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "raysplats/context.hpp"
#include "raysplats/gaussians.hpp"

namespace raysplats {

/// Gaussians on a device. Every change gives the model another revision: tracers follow it by
/// themselves, and refuse gradients of a state that is gone.
/// Threads: as Context.
class Model {
 public:
  /// Copies the Gaussians to the device. Throws UsageError when their arrays do not fit each other
  /// or the SH degree is not 0 to 4, DataError when a number is not finite, ResourceError when the
  /// device has too little memory.
  Model(Context& context, const Gaussians& gaussians);
  ~Model();
  Model(Model&&) noexcept;
  Model& operator=(Model&&) noexcept;

  /// Replaces all parameters; number and SH degree may be others. Throws as the constructor and
  /// leaves the model as it was then.
  void assign(const Gaussians& gaussians);
  /// The parameters as they are; blocks.
  Gaussians download() const;

  /// Number of Gaussians.
  std::size_t size() const;
  /// 0 to 4.
  int sh_degree() const;
  /// Another number after every change, never the same twice in a context.
  std::uint64_t revision() const;
  /// The context that it was made with.
  Context& context() const;

  /// Of the library itself; not installed.
  struct Impl;
  Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
