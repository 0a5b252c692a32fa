// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace raysplats {

/// The tree by which things in a row of slots are added: a node of level k holds the slots
/// [first, first + 2^k) that there are, first is a multiple of 2^k, and its sum is that of its two
/// halves. So the order of adding depends on the number of slots alone, not on who adds.
struct PairwiseNode {
  std::size_t first = 0;
  int level = 0;

  std::size_t end() const { return first + (std::size_t{1} << level); }
  bool operator==(const PairwiseNode&) const = default;
};

/// Adds what comes in the order of the slots, as far up the tree as that goes. `T` is what the
/// nodes have. Of B values in a row at most log2(B) + 1 are kept.
template <class T>
class PairwiseSum {
 public:
  using Part = std::pair<PairwiseNode, T>;

  /// `add(T& left, T& right)` leaves the sum in `left`. `node` is the one that follows.
  template <class Add>
  void push(PairwiseNode node, T value, const Add& add) {
    parts_.emplace_back(node, std::move(value));
    while (parts_.size() > 1) {
      Part& left = parts_[parts_.size() - 2];
      const Part& right = parts_.back();
      const bool halves = left.first.level == right.first.level &&
                          left.first.end() == right.first.first &&
                          left.first.first % (std::size_t{2} << left.first.level) == 0;
      if (!halves) return;
      merge(add);
    }
  }
  /// Once all slots up to the last one are in: slots beyond it would be the right halves of what is
  /// still open, and a half that is missing adds nothing. One part is left, or none.
  template <class Add>
  void finish(const Add& add) {
    while (parts_.size() > 1) merge(add);
  }

  const std::vector<Part>& parts() const { return parts_; }
  Part take_last() {
    Part last = std::move(parts_.back());
    parts_.pop_back();
    return last;
  }
  std::vector<Part> take() { return std::exchange(parts_, {}); }

 private:
  template <class Add>
  void merge(const Add& add) {
    Part& left = parts_[parts_.size() - 2];
    add(left.second, parts_.back().second);
    left.first.level = std::max(left.first.level, parts_.back().first.level) + 1;
    parts_.pop_back();
  }

  std::vector<Part> parts_;
};

/// The nodes that are left when the slots [first, last) are added.
std::vector<PairwiseNode> pairwise_nodes(std::size_t first, std::size_t last);

}  // namespace raysplats
