// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>

namespace raysplats::peer {

/// The nearest Capacity hits of a ray in ascending order of (t, index). Both lie in one 64-bit key,
/// whose order is theirs because t >= 0. Insertion shifts what lies behind the new hit, which is
/// little because a traversal finds hits nearly in order.
template <int Capacity>
class KBuffer {
 public:
  static constexpr std::uint64_t key_of(float t, std::uint32_t index) {
    return std::uint64_t{std::bit_cast<std::uint32_t>(t)} << 32 | index;
  }
  static float t_of(std::uint64_t key) {
    return std::bit_cast<float>(static_cast<std::uint32_t>(key >> 32));
  }

  /// A new ray.
  void start() {
    behind_ = 0;
    size_ = 0;
  }
  /// The next traversal of the ray: only hits behind the last one count.
  void resume() {
    behind_ = keys_[Capacity - 1];
    size_ = 0;
  }

  int size() const { return size_; }
  bool full() const { return size_ == Capacity; }
  std::uint32_t index(int i) const { return static_cast<std::uint32_t>(keys_[i]); }
  float alpha(int i) const { return alphas_[i]; }
  /// Depth of the last hit.
  float last_t() const { return t_of(keys_[size_ - 1]); }

  bool wants(std::uint64_t candidate) const {
    return candidate > behind_ && !(full() && candidate > keys_[Capacity - 1]);
  }

  void insert(std::uint64_t new_key, float new_alpha) {
    int i = size_ < Capacity ? size_++ : Capacity - 1;
    for (; i > 0 && keys_[i - 1] > new_key; --i) {
      keys_[i] = keys_[i - 1];
      alphas_[i] = alphas_[i - 1];
    }
    keys_[i] = new_key;
    alphas_[i] = new_alpha;
  }

 private:
  std::uint64_t keys_[Capacity];
  float alphas_[Capacity];
  std::uint64_t behind_ = 0;  ///< key of the last hit blended
  int size_ = 0;
};

}  // namespace raysplats::peer
