// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unistd.h>

namespace raysplats {

/// Until the end of a scope root is nobody, who may do what permissions say; others stay who they
/// are.
class NoRights {
 public:
  NoRights() : root_(::geteuid() == 0) {
    if (root_) changed_ = ::seteuid(65534);
  }
  ~NoRights() {
    if (root_) changed_ = ::seteuid(0);
  }
  NoRights(const NoRights&) = delete;
  NoRights& operator=(const NoRights&) = delete;

 private:
  bool root_;
  [[maybe_unused]] int changed_ = 0;
};

}  // namespace raysplats
