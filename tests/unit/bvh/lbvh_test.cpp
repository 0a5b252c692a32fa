// SPDX-License-Identifier: Apache-2.0
#include "bvh/lbvh.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cfloat>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "base/rng.hpp"
#include "bvh/lbvh_validate.hpp"
#include "raysplats/error.hpp"

using namespace raysplats;

namespace {

using Boxes = std::vector<RsAabb>;

const ChunkShape kShapes[] = {{1, 1, 1}, {3, 1, 16}, {64, 1, 1}, {8, 64, 64}};

RsAabb box_at(double x, double y, double z, double hx, double hy, double hz) {
  const double c[3] = {x, y, z};
  const double h[3] = {hx, hy, hz};
  RsAabb box;
  for (int axis = 0; axis < 3; ++axis) {
    box.lo[axis] = static_cast<float>(c[axis] - h[axis]);
    box.hi[axis] = static_cast<float>(c[axis] + h[axis]);
  }
  return box;
}

Boxes random_boxes(std::size_t count, double size, std::uint64_t seed) {
  CounterRng rng(seed, 3);
  Boxes boxes(count);
  for (RsAabb& box : boxes) {
    const double x = rng.normal(), y = rng.normal(), z = 0.2 * rng.normal();
    box = box_at(x, y, z, size * rng.uniform(), size * rng.uniform(), size * rng.uniform());
  }
  return boxes;
}

Buffer<RsAabb> uploaded(Context& context, const Boxes& boxes) {
  Buffer<RsAabb> buffer(context, boxes.size(), "boxes");
  buffer.upload(boxes);
  return buffer;
}

// Recursive builder: splits where the highest differing bit of (code, position) changes.
struct HostTree {
  std::vector<std::uint32_t> leaves;
  std::vector<std::uint64_t> codes;  // sorted
  std::vector<RsBvhNode> nodes;
  const Boxes* boxes;

  explicit HostTree(const Boxes& input) : boxes(&input) {
    const std::vector<std::uint64_t> by_box = morton_codes(input);
    leaves.resize(input.size());
    std::iota(leaves.begin(), leaves.end(), 0u);
    std::stable_sort(leaves.begin(), leaves.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return by_box[a] < by_box[b]; });
    for (const std::uint32_t leaf : leaves) codes.push_back(by_box[leaf]);
    if (input.size() > 1) {
      nodes.resize(input.size() - 1);
      RsAabb bounds;
      make(0, input.size() - 1, 0, bounds);
    }
  }

  std::size_t split_of(std::size_t first, std::size_t last) const {
    // Positions decide among equal codes.
    const bool tied = codes[first] == codes[last];
    const auto key = [&](std::size_t i) { return tied ? static_cast<std::uint64_t>(i) : codes[i]; };
    const int bit = 63 - std::countl_zero(key(first) ^ key(last));
    std::size_t split = first;
    while ((key(split + 1) >> bit & 1) == 0) ++split;
    return split;
  }

  std::int32_t make(std::size_t first, std::size_t last, std::size_t number, RsAabb& bounds) {
    if (first == last) {
      bounds = (*boxes)[leaves[first]];
      bool good = true;
      for (int a = 0; a < 3; ++a) {
        good = good && std::isfinite(bounds.lo[a]) && std::isfinite(bounds.hi[a]) &&
               bounds.lo[a] <= bounds.hi[a];
      }
      if (!good) bounds = {{FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX}};
      return ~static_cast<std::int32_t>(first);
    }
    const std::size_t split = split_of(first, last);
    RsBvhNode node;
    RsAabb left;
    RsAabb right;
    node.left = make(first, split, split, left);
    node.right = make(split + 1, last, split + 1, right);
    node.first = static_cast<std::int32_t>(first);
    node.last = static_cast<std::int32_t>(last);
    for (int a = 0; a < 3; ++a) {
      node.left_lo[a] = left.lo[a];
      node.left_hi[a] = left.hi[a];
      node.right_lo[a] = right.lo[a];
      node.right_hi[a] = right.hi[a];
      bounds.lo[a] = std::min(left.lo[a], right.lo[a]);
      bounds.hi[a] = std::max(left.hi[a], right.hi[a]);
    }
    nodes[number] = node;
    return static_cast<std::int32_t>(number);
  }
};

bool same_nodes(const std::vector<RsBvhNode>& a, const std::vector<RsBvhNode>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(RsBvhNode)) == 0);
}

void check_tree(Context& context, Lbvh& tree, const Boxes& boxes) {
  CAPTURE(boxes.size());
  tree.build(uploaded(context, boxes), boxes.size());
  CHECK(tree.size() == boxes.size());
  CHECK(validate_lbvh(tree, boxes) == "");
  const HostTree expected(boxes);
  CHECK(tree.leaves().download() == expected.leaves);
  CHECK(same_nodes(tree.nodes().download(), expected.nodes));
}

// Boxes that the test accepts, by walking the tree on the host with the same test on child bounds.
template <class Test>
std::set<std::uint32_t> query(const Lbvh& tree, const Boxes& boxes, const Test& test) {
  const std::vector<RsBvhNode> nodes = tree.nodes().download();
  const std::vector<std::uint32_t> leaves = tree.leaves().download();
  std::set<std::uint32_t> found;
  std::vector<std::int32_t> stack{tree.root()};
  while (!stack.empty()) {
    const std::int32_t reference = stack.back();
    stack.pop_back();
    if (reference < 0) {
      const std::uint32_t box = leaves[static_cast<std::size_t>(~reference)];
      if (test(boxes[box].lo, boxes[box].hi)) found.insert(box);
      continue;
    }
    const RsBvhNode& node = nodes[static_cast<std::size_t>(reference)];
    if (test(node.left_lo, node.left_hi)) stack.push_back(node.left);
    if (test(node.right_lo, node.right_hi)) stack.push_back(node.right);
  }
  return found;
}

template <class Test>
std::set<std::uint32_t> brute_force(const Boxes& boxes, const Test& test) {
  std::set<std::uint32_t> found;
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    if (test(boxes[i].lo, boxes[i].hi)) found.insert(i);
  }
  return found;
}

// Boxes in dense clumps of [-1, 1]^3, the last `far` of them at distances up to `distance`.
Boxes clumps(std::size_t count, std::size_t far, double distance) {
  CounterRng rng(17, 6);
  Boxes boxes(count);
  std::vector<std::array<double, 3>> centers(40);
  for (auto& c : centers) c = {rng.uniform() * 2 - 1, rng.uniform() * 2 - 1, rng.uniform() * 2 - 1};
  for (RsAabb& box : boxes) {
    const auto& c = centers[rng.below(centers.size())];
    const double h = 0.002 + 0.004 * rng.uniform();
    box = box_at(c[0] + 0.05 * rng.normal(), c[1] + 0.05 * rng.normal(), c[2] + 0.05 * rng.normal(),
                 h, h, h);
  }
  for (std::size_t i = 0; i < far; ++i) {
    const double r = distance / static_cast<double>(1 + i * i);
    boxes[(i + 1) * (count / (far + 1))] =
        box_at(r * rng.normal(), r * rng.normal(), r * rng.normal(), 0.01, 0.01, 0.01);
  }
  return boxes;
}

// Area of all boxes of the tree inside [-1, 1]^3 over the cube's: boxes that a line through the
// cube meets there.
double inner_cost(const Lbvh& tree) {
  double sum = 0;
  for (const RsBvhNode& node : tree.nodes().download()) {
    for (const auto& [lo, hi] :
         {std::pair(node.left_lo, node.left_hi), std::pair(node.right_lo, node.right_hi)}) {
      double e[3];
      for (int a = 0; a < 3; ++a) e[a] = std::min(hi[a], 1.0f) - std::max(lo[a], -1.0f);
      if (e[0] >= 0 && e[1] >= 0 && e[2] >= 0) sum += e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
    }
  }
  return sum / 12;
}

struct RayTest {
  double origin[3];
  double direction[3];
  bool operator()(const float* lo, const float* hi) const {
    double near = 0;
    double far = std::numeric_limits<double>::infinity();
    for (int a = 0; a < 3; ++a) {
      const double t0 = ((direction[a] > 0 ? lo[a] : hi[a]) - origin[a]) / direction[a];
      const double t1 = ((direction[a] > 0 ? hi[a] : lo[a]) - origin[a]) / direction[a];
      near = std::max(near, t0);
      far = std::min(far, t1);
    }
    return near <= far;
  }
};

struct OverlapTest {
  RsAabb box;
  bool operator()(const float* lo, const float* hi) const {
    for (int a = 0; a < 3; ++a) {
      if (!(lo[a] <= box.hi[a] && hi[a] >= box.lo[a])) return false;
    }
    return true;
  }
};

void check_queries(const Lbvh& tree, const Boxes& boxes, std::uint64_t seed) {
  CounterRng rng(seed, 4);
  std::size_t hits = 0;
  for (int i = 0; i < 20; ++i) {
    RayTest ray{};
    for (int a = 0; a < 3; ++a) {
      ray.origin[a] = 2 * rng.normal();
      ray.direction[a] = 0.3 * rng.normal() - ray.origin[a];
    }
    const auto expected = brute_force(boxes, ray);
    hits += expected.size();
    CHECK(query(tree, boxes, ray) == expected);
    const OverlapTest overlap{box_at(rng.normal(), rng.normal(), 0, 0.2, 0.2, 0.2)};
    CHECK(query(tree, boxes, overlap) == brute_force(boxes, overlap));
  }
  CHECK(hits > 0);
}

}  // namespace

TEST_CASE("lbvh: equals the recursive host builder for every size and division of the work") {
  Context context(select_device(""));
  for (const ChunkShape& shape : kShapes) {
    CAPTURE(shape.groups);
    CAPTURE(shape.group_size);
    Lbvh tree(context, shape);
    for (const std::size_t count : {0u, 1u, 2u, 3u, 5u, 17u, 64u, 65u, 1000u}) {
      check_tree(context, tree, random_boxes(count, 0.1, count + 1));
    }
  }
}

TEST_CASE("lbvh: a large tree on the device's own shape, with queries") {
  Context context(select_device(""));
  Lbvh tree(context);
  const Boxes boxes = random_boxes(50000, 0.03, 11);
  check_tree(context, tree, boxes);
  check_queries(tree, boxes, 5);
  const LbvhQuality quality = lbvh_quality(tree);
  CHECK(quality.depth >= 16);
  CHECK(quality.depth <= 64);
  CHECK(quality.sah_cost > 1);
  check_tree(context, tree, random_boxes(30, 0.1, 12));  // smaller after larger
}

TEST_CASE("lbvh: coincident, aligned and clustered centres") {
  Context context(select_device(""));
  for (const ChunkShape& shape : kShapes) {
    CAPTURE(shape.groups);
    CAPTURE(shape.group_size);
    Lbvh tree(context, shape);
    check_tree(context, tree, Boxes(777, box_at(1, 2, 3, 0.5, 0.5, 0.5)));
    check_tree(context, tree, Boxes(40, box_at(0, 0, 0, 0, 0, 0)));
    Boxes line;
    for (int i = 0; i < 500; ++i) line.push_back(box_at(0, i % 50, 0, 0.1, 0, 0));  // runs of ten
    check_tree(context, tree, line);
    // Clusters far below a cell of the high words but above one of the low words, in short and long
    // runs.
    for (const std::size_t run : {7u, 300u}) {
      CounterRng rng(run, 5);
      Boxes clusters;
      for (int cluster = 0; cluster < 4; ++cluster) {
        for (std::size_t i = 0; i < run; ++i) {
          const double offset = 3e-6 * rng.uniform();
          clusters.push_back(
              box_at(0.0625 + cluster * 0.25 + offset, 0.1 + offset, 0.1, 1e-4, 1e-4, 1e-4));
        }
      }
      check_tree(context, tree, clusters);
    }
  }
}

TEST_CASE("lbvh: empty, non-finite, huge and tiny boxes") {
  Context context(select_device(""));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  Boxes boxes = random_boxes(300, 0.1, 21);
  boxes[3] = {{1, 1, 1}, {0, 2, 2}};
  boxes[4] = {{nan, 0, 0}, {1, 1, 1}};
  boxes[5] = {{0, 0, 0}, {1, nan, 1}};
  boxes[6] = {{-infinity, 0, 0}, {1, 1, 1}};
  boxes[7] = {{0, 0, 0}, {1, 1, infinity}};
  boxes[8] = {{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
  boxes[9] = {{FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX}};
  for (const ChunkShape& shape : kShapes) {
    Lbvh tree(context, shape);
    check_tree(context, tree, boxes);
    const std::vector<std::uint32_t> leaves = tree.leaves().download();
    CHECK(std::set<std::uint32_t>(leaves.end() - 7, leaves.end()) ==
          std::set<std::uint32_t>{3, 4, 5, 6, 7, 8, 9});
    check_tree(context, tree, Boxes(5, boxes[4]));
    Boxes extreme = boxes;
    extreme[10] = {{-FLT_MAX, -FLT_MAX, -FLT_MAX}, {FLT_MAX, FLT_MAX, FLT_MAX}};
    extreme[11] = {{FLT_MAX, FLT_MAX, FLT_MAX}, {FLT_MAX, FLT_MAX, FLT_MAX}};
    extreme[12] = {{-FLT_MAX, 0, 0}, {-FLT_MAX, 0, 0}};
    check_tree(context, tree, extreme);
    check_tree(
        context, tree,
        {box_at(1e-20, 0, 0, 0, 0, 0), box_at(2e-20, 1e-20, 0, 0, 0, 0), box_at(0, 0, 0, 1, 1, 1)});
  }
}

TEST_CASE("lbvh: a few boxes far away leave the order of the others as fine as it was") {
  Context context(select_device(""));
  Lbvh tree(context);
  const std::size_t count = 20000;
  check_tree(context, tree, clumps(count, 0, 0));
  const double alone = inner_cost(tree);
  for (const double distance : {1e2, 1e4, 1e7, 1e20}) {
    CAPTURE(distance);
    const Boxes boxes = clumps(count, 20, distance);
    check_tree(context, tree, boxes);
    CHECK(inner_cost(tree) < 1.3 * alone);
    // Nearly all boxes have a high word of their own: sorting by it is enough.
    std::set<std::uint64_t> words;
    for (const std::uint64_t code : morton_codes(boxes)) words.insert(code >> 32);
    CHECK(words.size() > count / 2);
  }
}

TEST_CASE("lbvh: far boxes in every division of the work [small] [tiny]") {
  Context context(select_device(""));
  for (const ChunkShape& shape : {ChunkShape{3, 1, 16}, ChunkShape{2, 16, 16}}) {
    Lbvh tree(context, shape);
    Boxes boxes = clumps(600, 2, 1e5);
    check_tree(context, tree, boxes);
    check_tree(context, tree, clumps(70, 0, 0));
    tree.refit(uploaded(context, clumps(70, 1, 10)));
    CHECK(validate_lbvh(tree, clumps(70, 1, 10), LeafOrder::kAny) == "");
  }
}

TEST_CASE("lbvh: refit") {
  Context context(select_device(""));
  for (const ChunkShape& shape : kShapes) {
    CAPTURE(shape.groups);
    CAPTURE(shape.group_size);
    Lbvh tree(context, shape);
    for (const std::size_t count : {1u, 2u, 1500u}) {
      Boxes boxes = random_boxes(count, 0.1, 31);
      tree.build(uploaded(context, boxes), count);
      const std::vector<RsBvhNode> built = tree.nodes().download();
      tree.refit(uploaded(context, boxes));
      CHECK(same_nodes(tree.nodes().download(), built));
      // Moved boxes, one of which vanishes: bounds follow, the order stays.
      const std::vector<std::uint32_t> leaves = tree.leaves().download();
      boxes = random_boxes(count, 0.05, 32);
      if (count > 2) boxes[2] = {{1, 1, 1}, {-1, -1, -1}};
      tree.refit(uploaded(context, boxes));
      CHECK(tree.leaves().download() == leaves);
      CHECK(validate_lbvh(tree, boxes, LeafOrder::kAny) == "");
      if (count > 2) {
        CHECK(validate_lbvh(tree, boxes, LeafOrder::kMorton) != "");
        check_queries(tree, boxes, 6);
      }
    }
  }
}

TEST_CASE("lbvh: cost equals the sum over the nodes and tells an outdated order [small]") {
  Context context(select_device(""));
  for (const ChunkShape& shape : {ChunkShape{3, 1, 16}, ChunkShape{2, 16, 16}}) {
    Lbvh tree(context, shape);
    CHECK(tree.cost() == 0);
    Boxes boxes = random_boxes(700, 0.1, 41);
    boxes[5] = {{1, 1, 1}, {-1, -1, -1}};
    tree.build(uploaded(context, boxes), boxes.size());
    double inner = 0;
    double leaves = 0;
    const auto add = [&](const float* lo, const float* hi, std::int32_t reference) {
      double e[3];
      for (int a = 0; a < 3; ++a) e[a] = static_cast<double>(hi[a]) - static_cast<double>(lo[a]);
      if (e[0] < 0) return;
      (reference < 0 ? leaves : inner) += e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
    };
    for (const RsBvhNode& node : tree.nodes().download()) {
      add(node.left_lo, node.left_hi, node.left);
      add(node.right_lo, node.right_hi, node.right);
    }
    const double built = tree.cost();
    CHECK(built == doctest::Approx(inner / leaves).epsilon(1e-5));
    // The same boxes in another order: refitted, the tree is far worse than built anew.
    const Boxes moved(boxes.rbegin(), boxes.rend());
    tree.refit(uploaded(context, moved));
    CHECK(tree.cost() > 2 * built);
    tree.build(uploaded(context, moved), moved.size());
    CHECK(tree.cost() == doctest::Approx(built).epsilon(0.05));
    tree.build(uploaded(context, Boxes(3, boxes[5])), 3);
    CHECK(tree.cost() == 0);
  }
}

TEST_CASE("lbvh: sizes that do not fit are refused") {
  Context context(select_device(""));
  Lbvh tree(context);
  const Boxes boxes = random_boxes(10, 0.1, 1);
  CHECK_THROWS_AS(tree.build(uploaded(context, boxes), 11), UsageError);
  tree.build(uploaded(context, boxes), 10);
  CHECK_THROWS_AS(tree.refit(uploaded(context, random_boxes(9, 0.1, 1))), UsageError);
}

TEST_CASE("lbvh validation: faults are found") {
  Context context(select_device(""));
  Lbvh tree(context);
  Boxes boxes = random_boxes(100, 0.1, 1);
  tree.build(uploaded(context, boxes), boxes.size());
  CHECK(validate_lbvh(tree, boxes) == "");
  Boxes grown = boxes;
  grown[50].hi[1] += 0.5f;
  CHECK(validate_lbvh(tree, grown, LeafOrder::kAny) != "");
  CHECK(validate_lbvh(tree, std::span<const RsAabb>(boxes).first(99)) != "");
}
