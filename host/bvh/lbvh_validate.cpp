// SPDX-License-Identifier: Apache-2.0
#include "bvh/lbvh_validate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cfloat>
#include <cmath>
#include <numeric>

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

RsAabb child_box(const RsBvhNode& node, bool right) {
  RsAabb box;
  std::copy_n(right ? node.right_lo : node.left_lo, 3, box.lo);
  std::copy_n(right ? node.right_hi : node.left_hi, 3, box.hi);
  return box;
}

std::array<float, 3> center(const RsAabb& box) {
  std::array<float, 3> c{};
  for (std::size_t axis = 0; axis < 3; ++axis) c[axis] = 0.5f * box.lo[axis] + 0.5f * box.hi[axis];
  return c;
}

std::uint64_t spread_bits(std::uint32_t x) {
  std::uint64_t out = 0;
  for (int bit = 0; bit < 21; ++bit) out |= static_cast<std::uint64_t>(x >> bit & 1u) << (3 * bit);
  return out;
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

double area(const RsAabb& box) {
  double e[3];
  for (int axis = 0; axis < 3; ++axis) {
    e[axis] = static_cast<double>(box.hi[axis]) - static_cast<double>(box.lo[axis]);
    if (e[axis] < 0) return 0;
  }
  return 2 * (e[0] * e[1] + e[1] * e[2] + e[2] * e[0]);
}

// "" when leaves[] is a permutation in the wanted order.
std::string check_leaves(const std::vector<std::uint32_t>& leaves,
                         std::span<const RsAabb> boxes,
                         LeafOrder order) {
  std::vector<bool> seen(leaves.size(), false);
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    if (leaves[i] >= leaves.size())
      return fmt::format("Leaf {} names box {} of {}", i, leaves[i], leaves.size());
    if (seen[leaves[i]])
      return fmt::format("Box {} is the leaf of two places, the second is {}", leaves[i], i);
    seen[leaves[i]] = true;
  }
  if (order == LeafOrder::kAny) return "";
  const std::vector<std::uint64_t> codes = morton_codes(boxes);
  for (std::size_t i = 1; i < leaves.size(); ++i) {
    const std::uint64_t before = codes[leaves[i - 1]];
    const std::uint64_t here = codes[leaves[i]];
    if (before > here || (before == here && leaves[i - 1] > leaves[i])) {
      return fmt::format("Leaves {} and {} are out of Morton order", i - 1, i);
    }
  }
  return "";
}

struct Visit {
  std::int32_t reference;
  std::int32_t first;
  std::int32_t last;
  RsAabb bounds;  // what the parent says
};

}  // namespace

std::vector<std::uint64_t> morton_codes(std::span<const RsAabb> boxes) {
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
    codes[i] = inside ? 0 : std::uint64_t{1} << 63;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float cell = inside ? (0.5f * c[axis] - window.lo[axis]) * fine
                                : (0.5f * c[axis] - middle[axis]) * coarse + 1048576.0f;
      const float last = inside ? 2097151.0f : 2097150.0f;
      const auto number = static_cast<std::uint32_t>(std::clamp(cell, 0.0f, last));
      codes[i] |= spread_bits(inside && fine == 0 ? 0 : number) << (2 - axis);
    }
  }
  return codes;
}

std::string validate_lbvh(const Lbvh& tree, std::span<const RsAabb> boxes, LeafOrder order) {
  const std::size_t count = tree.size();
  if (boxes.size() != count)
    return fmt::format("The tree has {} leaves for {} boxes", count, boxes.size());
  if (count == 0) return "";
  const std::vector<std::uint32_t> leaves = tree.leaves().download();
  if (std::string fault = check_leaves(leaves, boxes, order); !fault.empty()) return fault;
  if (count == 1) return "";
  const std::vector<RsBvhNode> nodes = tree.nodes().download();
  std::vector<bool> reached(nodes.size(), false);
  std::size_t reached_count = 0;
  const RsBvhNode& top = nodes[0];
  std::vector<Visit> stack{{0, 0, static_cast<std::int32_t>(count) - 1,
                            united(child_box(top, false), child_box(top, true))}};
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    if (visit.reference < 0) {
      const std::int32_t leaf = ~visit.reference;
      if (leaf != visit.first || leaf != visit.last) {
        return fmt::format("Leaf {} stands for the range {}..{}", leaf, visit.first, visit.last);
      }
      const RsAabb& box = boxes[leaves[static_cast<std::size_t>(leaf)]];
      if (!equal(visit.bounds, valid(box) ? box : kEmpty))
        return fmt::format("Leaf {} has other bounds than its box", leaf);
      continue;
    }
    const auto number = static_cast<std::size_t>(visit.reference);
    if (number >= nodes.size())
      return fmt::format("A child refers to node {} of {}", number, nodes.size());
    if (reached[number]) return fmt::format("Node {} has two parents", number);
    reached[number] = true;
    ++reached_count;
    const RsBvhNode& node = nodes[number];
    if (node.first != visit.first || node.last != visit.last) {
      return fmt::format("Node {} covers {}..{}, its parent says {}..{}", number, node.first,
                         node.last, visit.first, visit.last);
    }
    const std::int32_t split = node.left < 0 ? ~node.left : node.left;
    if (split < node.first || split >= node.last)
      return fmt::format("Node {} splits outside its range", number);
    const RsAabb left = child_box(node, false);
    const RsAabb right = child_box(node, true);
    if (!equal(visit.bounds, united(left, right))) {
      return fmt::format("Node {} has other bounds than its children together", number);
    }
    stack.push_back({node.left, node.first, split, left});
    stack.push_back({node.right, split + 1, node.last, right});
  }
  if (reached_count != nodes.size()) {
    return fmt::format("{} of {} nodes are not in the tree", nodes.size() - reached_count,
                       nodes.size());
  }
  return "";
}

LbvhQuality lbvh_quality(const Lbvh& tree) {
  LbvhQuality quality;
  if (tree.size() < 2) return quality;
  const std::vector<RsBvhNode> nodes = tree.nodes().download();
  double sum = 0;
  for (const RsBvhNode& node : nodes)
    sum += area(child_box(node, false)) + area(child_box(node, true));
  const double root = area(united(child_box(nodes[0], false), child_box(nodes[0], true)));
  quality.sah_cost = root > 0 ? 1 + sum / root : 0;
  std::vector<std::pair<std::int32_t, int>> stack{{0, 1}};
  while (!stack.empty()) {
    const auto [number, depth] = stack.back();
    stack.pop_back();
    quality.depth = std::max(quality.depth, depth);
    const RsBvhNode& node = nodes[static_cast<std::size_t>(number)];
    if (node.left >= 0) stack.emplace_back(node.left, depth + 1);
    if (node.right >= 0) stack.emplace_back(node.right, depth + 1);
  }
  return quality;
}

}  // namespace raysplats
