// SPDX-License-Identifier: Apache-2.0
#include "bvh/lbvh_validate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cfloat>
#include <cmath>

#include "shared/tree_layout.h"

namespace raysplats {
namespace {

constexpr RsAabb kEmpty{{FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX}};
constexpr std::uint64_t kLastCode = ~std::uint64_t{0};

bool valid(const RsAabb& box) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(box.lo[axis]) || !std::isfinite(box.hi[axis]) ||
        !(box.lo[axis] <= box.hi[axis]))
      return false;
  }
  return true;
}

RsAabb united(const RsAabb& a, const RsAabb& b) {
  RsAabb out;
  for (int axis = 0; axis < 3; ++axis) {
    out.lo[axis] = std::min(a.lo[axis], b.lo[axis]);
    out.hi[axis] = std::max(a.hi[axis], b.hi[axis]);
  }
  return out;
}

bool equal(const RsAabb& a, const RsAabb& b) {
  return std::equal(a.lo, a.lo + 3, b.lo) && std::equal(a.hi, a.hi + 3, b.hi);
}

std::array<float, 3> center(const RsAabb& box) {
  std::array<float, 3> c{};
  for (std::size_t axis = 0; axis < 3; ++axis) c[axis] = 0.5f * box.lo[axis] + 0.5f * box.hi[axis];
  return c;
}

// Halves of the centres' range, as all lengths of the grid.
struct Window {
  std::array<float, 3> lo;
  std::array<float, 3> hi;
  float longest() const { return std::max({hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]}); }
};

// The power of two that brings `longest` below 2^bits; 0 where there is nothing to divide.
float power_scale(float longest, int bits) {
  if (!(longest > 0x1p-100f)) return 0.0f;
  int exponent = 0;
  std::frexp(longest, &exponent);
  return std::ldexp(1.0f, bits - exponent);
}

// One step towards the window that holds all but 1/256 of the sample on every side.
Window narrowed(const std::vector<std::array<float, 3>>& sample, const Window& window) {
  constexpr std::size_t kBins = 64;
  const float scale = power_scale(window.longest(), 6);
  Window next = window;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::array<std::size_t, kBins> bins{};
    for (const std::array<float, 3>& c : sample) {
      ++bins[static_cast<std::size_t>(
          std::clamp((0.5f * c[axis] - window.lo[axis]) * scale, 0.0f, 63.0f))];
    }
    const std::size_t tail = sample.size() / 256;
    std::size_t first = 0;
    for (std::size_t below = bins[0]; below <= tail && first < kBins - 1;) below += bins[++first];
    std::size_t last = kBins - 1;
    for (std::size_t above = bins[last]; above <= tail && last > first;) above += bins[--last];
    if (first > 0) --first;
    next.lo[axis] = window.lo[axis] + static_cast<float>(first) / scale;
    next.hi[axis] = std::min(
        window.hi[axis], window.lo[axis] + static_cast<float>(std::min(last + 2, kBins)) / scale);
  }
  return next;
}

// Where nearly all centres are, or `whole` when that is not much smaller.
Window main_window(std::span<const RsAabb> boxes, const Window& whole) {
  const std::size_t size = std::min<std::size_t>(boxes.size(), 2048);
  std::vector<std::array<float, 3>> sample;
  for (std::size_t i = 0; i < size; ++i) {
    const RsAabb& box = boxes[i * boxes.size() / size];
    if (valid(box)) sample.push_back(center(box));
  }
  Window window = whole;
  for (int round = 0; round < 32; ++round) {
    const float before = window.longest();
    if (!(power_scale(before, 6) > 0)) break;
    window = narrowed(sample, window);
    if (2 * window.longest() > before) break;
  }
  const float margin = 0.5f * window.longest();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    window.lo[axis] = std::max(whole.lo[axis], window.lo[axis] - margin);
    window.hi[axis] = std::min(whole.hi[axis], window.hi[axis] + margin);
  }
  return 16 * window.longest() < whole.longest() ? window : whole;
}

// Position of a cell along a Hilbert curve of 21 bits per axis, by transposed axes (Skilling 2004).
std::uint64_t hilbert_code(const std::array<std::uint32_t, 3>& cell) {
  std::array<std::uint32_t, 3> x = cell;
  constexpr std::uint32_t kTop = 1u << 20;
  for (std::uint32_t bit = kTop; bit > 1; bit >>= 1) {
    for (std::uint32_t& coordinate : x) {
      if ((coordinate & bit) != 0) {
        x[0] ^= bit - 1;
        continue;
      }
      const std::uint32_t swapped = (x[0] ^ coordinate) & (bit - 1);
      x[0] ^= swapped;
      coordinate ^= swapped;
    }
  }
  for (std::size_t axis = 1; axis < 3; ++axis) x[axis] ^= x[axis - 1];
  std::uint32_t parity = 0;
  for (std::uint32_t bit = kTop; bit > 1; bit >>= 1) {
    if ((x[2] & bit) != 0) parity ^= bit - 1;
  }
  std::uint64_t code = 0;
  for (int bit = 20; bit >= 0; --bit) {
    for (const std::uint32_t coordinate : x) code = code << 1 | ((coordinate ^ parity) >> bit & 1);
  }
  return code;
}

// "" when slots is a permutation in the wanted order.
std::string check_slots(const LbvhCopy& tree, std::span<const RsAabb> boxes, LeafOrder order) {
  std::vector<bool> seen(tree.count, false);
  if (tree.slots.size() < tree.count)
    return fmt::format("The tree has {} slots for {} boxes", tree.slots.size(), tree.count);
  for (std::size_t i = 0; i < tree.count; ++i) {
    const std::uint32_t box = tree.slots[i];
    if (box >= tree.count) return fmt::format("Slot {} names box {} of {}", i, box, tree.count);
    if (seen[box]) return fmt::format("Box {} is in two slots, the second is {}", box, i);
    seen[box] = true;
  }
  if (order == LeafOrder::kAny) return "";
  const std::vector<std::uint64_t> codes = curve_codes(boxes);
  std::uint64_t before = 0;  // largest code of the groups before
  for (std::size_t begin = 0; begin < tree.count; begin += tree.group) {
    const std::size_t end = std::min(begin + tree.group, tree.count);
    std::uint64_t largest = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint64_t code = codes[tree.slots[i]];
      if (code < before)
        return fmt::format("Slot {} belongs before its group of {} along the curve", i, tree.group);
      largest = std::max(largest, code);
    }
    before = largest;
  }
  return "";
}

// Union of the boxes in a block.
RsAabb block_box(const LbvhCopy& tree, std::span<const RsAabb> boxes, std::size_t block) {
  RsAabb sum = kEmpty;
  const std::size_t end = std::min((block + 1) * tree.lanes, tree.count);
  for (std::size_t slot = block * tree.lanes; slot < end; ++slot) {
    const RsAabb& box = boxes[tree.slots[slot]];
    if (valid(box)) sum = united(sum, box);
  }
  return sum;
}

RsAabb node_box(const LbvhCopy& tree, std::size_t node) {
  RsAabb sum = kEmpty;
  for (std::size_t lane = 0; lane < tree.lanes; ++lane) sum = united(sum, tree.child(node, lane));
  return sum;
}

}  // namespace

std::vector<std::uint64_t> curve_codes(std::span<const RsAabb> boxes) {
  Window whole{{FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX}};
  for (const RsAabb& box : boxes) {
    if (!valid(box)) continue;
    const std::array<float, 3> c = center(box);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      whole.lo[axis] = std::min(whole.lo[axis], 0.5f * c[axis]);
      whole.hi[axis] = std::max(whole.hi[axis], 0.5f * c[axis]);
    }
  }
  const Window window = main_window(boxes, whole);
  std::array<float, 3> middle{};
  float reach = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    middle[axis] = 0.5f * window.lo[axis] + 0.5f * window.hi[axis];
    reach = std::max({reach, middle[axis] - whole.lo[axis], whole.hi[axis] - middle[axis]});
  }
  const float fine = power_scale(window.longest(), 21);
  const float coarse = power_scale(reach, 20);
  std::vector<std::uint64_t> codes(boxes.size(), kLastCode);
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (!valid(boxes[i])) continue;
    const std::array<float, 3> c = center(boxes[i]);
    bool inside = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      inside = inside && 0.5f * c[axis] >= window.lo[axis] && 0.5f * c[axis] <= window.hi[axis];
    }
    std::array<std::uint32_t, 3> cell{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float at = inside ? (0.5f * c[axis] - window.lo[axis]) * fine
                              : (0.5f * c[axis] - middle[axis]) * coarse + 1048576.0f;
      if (inside && fine == 0) continue;
      cell[axis] =
          static_cast<std::uint32_t>(std::clamp(at, 0.0f, inside ? 2097151.0f : 2097150.0f));
    }
    codes[i] = (inside ? 0 : std::uint64_t{1} << 63) | hilbert_code(cell);
  }
  return codes;
}

LbvhCopy LbvhCopy::of(const Lbvh& tree) {
  LbvhCopy out;
  out.count = tree.size();
  out.lanes = static_cast<std::size_t>(tree.lanes());
  out.trail = tree.form().trail;
  out.group = tree.order_group();
  out.level_sizes = tree.level_sizes();
  if (out.count == 0) return out;
  out.level_begin = tree.level_begin().download();
  out.slots = tree.slots().download();
  out.nodes = tree.nodes().download();
  return out;
}

std::size_t LbvhCopy::at(std::size_t node, std::size_t k, std::size_t lane) const {
  // RS_NODE_FLOAT of cl/bvh/lbvh_node.h.
  const std::size_t of_child = trail ? lane * RS_NODE_VECTORS + k : k * lanes + lane;
  return node * RS_NODE_VECTORS * lanes + of_child;
}

RsAabb LbvhCopy::child(std::size_t node, std::size_t lane) const {
  RsAabb box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.lo[axis] = nodes[at(node, axis, lane)];
    box.hi[axis] = nodes[at(node, 3 + axis, lane)];
  }
  return box;
}

std::string validate_lbvh(const LbvhCopy& tree, std::span<const RsAabb> boxes, LeafOrder order) {
  if (boxes.size() != tree.count)
    return fmt::format("The tree has {} slots for {} boxes", tree.count, boxes.size());
  if (tree.count == 0) return "";
  if (std::string fault = check_slots(tree, boxes, order); !fault.empty()) return fault;
  std::size_t children = (tree.count + tree.lanes - 1) / tree.lanes;
  std::size_t begin = 0;
  for (std::size_t level = 1; level <= tree.level_sizes.size(); ++level) {
    const std::size_t size = tree.level_sizes[level - 1];
    if (size != (children + tree.lanes - 1) / tree.lanes || tree.level_begin[level] != begin) {
      return fmt::format("Level {} has {} nodes from {} over {} children", level, size,
                         tree.level_begin[level], children);
    }
    for (std::size_t child = 0; child < size * tree.lanes; ++child) {
      const RsAabb box = tree.child(begin + child / tree.lanes, child % tree.lanes);
      RsAabb expected = kEmpty;
      if (child < children) {
        expected = level == 1 ? block_box(tree, boxes, child)
                              : node_box(tree, begin - tree.level_sizes[level - 2] + child);
      }
      if (!equal(box, expected)) {
        return fmt::format(
            "Child {} of level {} has another box than {}", child, level,
            child >= children ? "the empty one of a missing child" : "what it holds together");
      }
    }
    children = size;
    begin += size;
  }
  if (children != 1) return fmt::format("The tree has {} roots", children);
  if (!equal(tree.child(begin, 0), node_box(tree, begin - 1)))
    return "The box of the scene is not the root's";
  return "";
}

}  // namespace raysplats
