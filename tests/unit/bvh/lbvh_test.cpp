// SPDX-License-Identifier: Apache-2.0
#include "bvh/lbvh.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cfloat>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "bvh/lbvh_validate.hpp"
#include "raysplats/error.hpp"
#include "unit/bvh/tree_forms.hpp"
#include "unit/failed_allocation.hpp"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

using Boxes = std::vector<RsAabb>;

const ChunkShape kShapes[] = {{1, 1, 1}, {3, 1, 16}, {8, 64, 64}};

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

// A tree whose blocks hold nothing but their boxes.
class Tree {
 public:
  Tree(Context& context, const TreeForm& form, const ChunkShape& shape)
      : context_(&context), lbvh_(context, form, shape) {}

  void build(const Boxes& boxes) {
    lbvh_.order(uploaded(*context_, boxes), boxes.size());
    refit(boxes);
  }
  void refit(const Boxes& boxes) {
    if (boxes.empty()) return;
    const std::size_t padded = lbvh_.padded_blocks();
    context_->kernel("bvh/node_probe.cl", "box_blocks", tree_build(lbvh_.form()))
        .launch(Range::linear(padded, 1), static_cast<std::uint32_t>(boxes.size()),
                static_cast<std::uint32_t>(padded), lbvh_.slots(), uploaded(*context_, boxes),
                lbvh_.nodes());
    lbvh_.merge();
  }
  LbvhCopy copy() const { return LbvhCopy::of(lbvh_); }
  double cost(const Boxes& boxes) { return lbvh_.cost(uploaded(*context_, boxes)); }
  Lbvh& lbvh() { return lbvh_; }

 private:
  Context* context_;
  Lbvh lbvh_;
};

void check_tree(Tree& tree, const Boxes& boxes) {
  CAPTURE(boxes.size());
  tree.build(boxes);
  CHECK(tree.lbvh().size() == boxes.size());
  CHECK(validate_lbvh(tree.copy(), boxes) == "");
}

// Boxes in dense clumps of [-1, 1]^3, the last `far` of them at distances up to `distance`.
Boxes clumps(std::size_t count, std::size_t far, double distance, double size = 1) {
  CounterRng rng(17, 6);
  Boxes boxes(count);
  std::vector<std::array<double, 3>> centers(40);
  for (auto& c : centers) c = {rng.uniform() * 2 - 1, rng.uniform() * 2 - 1, rng.uniform() * 2 - 1};
  for (RsAabb& box : boxes) {
    const auto& c = centers[rng.below(centers.size())];
    const double h = size * (0.002 + 0.004 * rng.uniform());
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

// What rays meet on their way through the whole tree.
struct Visits {
  std::size_t nodes = 0;
  std::size_t blocks = 0;
};

// Whether the ray origin + t direction, t >= 0, meets a box.
bool meets(const RsAabb& box,
           const std::array<double, 3>& origin,
           const std::array<double, 3>& direction) {
  double near = 0;
  double far = std::numeric_limits<double>::infinity();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (box.lo[axis] > box.hi[axis]) return false;
    double t0 = (static_cast<double>(box.lo[axis]) - origin[axis]) / direction[axis];
    double t1 = (static_cast<double>(box.hi[axis]) - origin[axis]) / direction[axis];
    if (t0 > t1) std::swap(t0, t1);
    near = std::max(near, t0);
    far = std::min(far, t1);
  }
  return near <= far;
}

Visits count_visits(const LbvhCopy& tree,
                    const std::array<double, 3>& origin,
                    const std::array<double, 3>& direction) {
  Visits visits;
  if (tree.count == 0) return visits;
  std::vector<std::array<std::size_t, 2>> stack{{tree.level_sizes.size(), 0}};
  while (!stack.empty()) {
    const auto [level, number] = stack.back();
    stack.pop_back();
    ++visits.nodes;
    for (std::size_t lane = 0; lane < tree.lanes; ++lane) {
      if (!meets(tree.child(tree.level_begin[level] + number, lane), origin, direction)) continue;
      if (level == 1) {
        ++visits.blocks;
      } else {
        stack.push_back({level - 1, number * tree.lanes + lane});
      }
    }
  }
  return visits;
}

// Of rays from all sides through the middle of [-1, 1]^3.
Visits visits_of(const LbvhCopy& tree) {
  CounterRng rng(23, 4);
  Visits sum;
  for (int i = 0; i < 200; ++i) {
    std::array<double, 3> origin{}, direction{};
    for (std::size_t a = 0; a < 3; ++a) {
      origin[a] = 2 * rng.normal();
      direction[a] = rng.uniform() - 0.5 - origin[a];
    }
    const Visits one = count_visits(tree, origin, direction);
    sum.nodes += one.nodes;
    sum.blocks += one.blocks;
  }
  return sum;
}

double half_area(const RsAabb& box) {
  double e[3];
  for (int a = 0; a < 3; ++a) e[a] = double(box.hi[a]) - double(box.lo[a]);
  return e[0] < 0 ? 0 : e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
}

// Sum of the areas of all children of all nodes over that of all boxes.
double host_cost(const LbvhCopy& tree, const Boxes& boxes) {
  double nodes = 0, leaves = 0;
  const std::size_t count =
      std::accumulate(tree.level_sizes.begin(), tree.level_sizes.end(), std::size_t{0});
  for (std::size_t node = 0; node < count; ++node) {
    for (std::size_t lane = 0; lane < tree.lanes; ++lane)
      nodes += half_area(tree.child(node, lane));
  }
  for (const RsAabb& box : boxes) leaves += half_area(box);
  return nodes / leaves;
}

}  // namespace

TEST_CASE("lbvh: the curve goes from cell to neighbouring cell through all of them") {
  constexpr int kSide = 16;
  Boxes boxes;
  for (int x = 0; x < kSide; ++x) {
    for (int y = 0; y < kSide; ++y) {
      for (int z = 0; z < kSide; ++z) boxes.push_back(box_at(x, y, z, 0.1, 0.1, 0.1));
    }
  }
  const std::vector<std::uint64_t> codes = curve_codes(boxes);
  std::vector<std::size_t> order(boxes.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return codes[a] < codes[b]; });
  for (std::size_t i = 1; i < order.size(); ++i) {
    CHECK(codes[order[i - 1]] < codes[order[i]]);
    double steps = 0;
    for (int a = 0; a < 3; ++a)
      steps += std::abs(double(boxes[order[i]].lo[a]) - double(boxes[order[i - 1]].lo[a]));
    CHECK(steps == doctest::Approx(1));
  }
}

TEST_CASE("lbvh: every size, width and division of the work") {
  Context context = make_test_context();
  for (const TreeForm& form : test::kTreeForms) {
    for (const ChunkShape& shape : kShapes) {
      if (form.lanes != 8 && shape.groups != 3) continue;
      CAPTURE(form);
      CAPTURE(shape.groups);
      CAPTURE(shape.group_size);
      Tree tree(context, form, shape);
      for (const std::size_t count : {0u, 1u, 2u, 17u, 65u, 257u, 5000u})
        check_tree(tree, random_boxes(count, 0.1, count + 1));
      check_tree(tree, random_boxes(30, 0.1, 12));  // smaller after larger
    }
  }
}

TEST_CASE("lbvh: the device's own shape [small] [tiny]") {
  Context context = make_test_context();
  Tree tree(context, tree_form(test_device()), ChunkShape::for_device(context.device()));
  check_tree(tree, random_boxes(700, 0.1, 3));
  check_tree(tree, clumps(70, 2, 1e5));
}

TEST_CASE("lbvh: coincident, aligned and clustered centres") {
  Context context = make_test_context();
  for (const ChunkShape& shape : kShapes) {
    CAPTURE(shape.groups);
    CAPTURE(shape.group_size);
    Tree tree(context, TreeForm{8, false}, shape);
    check_tree(tree, Boxes(777, box_at(1, 2, 3, 0.5, 0.5, 0.5)));
    check_tree(tree, Boxes(40, box_at(0, 0, 0, 0, 0, 0)));
    Boxes line;
    for (int i = 0; i < 500; ++i) line.push_back(box_at(0, i % 50, 0, 0.1, 0, 0));  // runs of ten
    check_tree(tree, line);
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
      check_tree(tree, clusters);
    }
  }
}

TEST_CASE("lbvh: empty, non-finite, huge and tiny boxes") {
  Context context = make_test_context();
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
    Tree tree(context, TreeForm{8, false}, shape);
    check_tree(tree, boxes);
    const std::vector<std::uint32_t> slots = tree.copy().slots;
    CHECK(std::set<std::uint32_t>(slots.end() - 7, slots.end()) ==
          std::set<std::uint32_t>{3, 4, 5, 6, 7, 8, 9});
    check_tree(tree, Boxes(5, boxes[4]));
    CHECK(tree.cost(Boxes(5, boxes[4])) == 0);
    Boxes extreme = boxes;
    extreme[10] = {{-FLT_MAX, -FLT_MAX, -FLT_MAX}, {FLT_MAX, FLT_MAX, FLT_MAX}};
    extreme[11] = {{FLT_MAX, FLT_MAX, FLT_MAX}, {FLT_MAX, FLT_MAX, FLT_MAX}};
    extreme[12] = {{-FLT_MAX, 0, 0}, {-FLT_MAX, 0, 0}};
    check_tree(tree, extreme);
    check_tree(tree, {box_at(1e-20, 0, 0, 0, 0, 0), box_at(2e-20, 1e-20, 0, 0, 0, 0),
                      box_at(0, 0, 0, 1, 1, 1)});
  }
}

TEST_CASE("lbvh: a few boxes far away cost rays at most half as many visits again") {
  Context context = make_test_context();
  for (const TreeForm& form : test::kUnlikeTreeForms) {
    Tree tree(context, form, ChunkShape::for_device(context.device()));
    const std::size_t count = 20000;
    // Boxes that overlap as Gaussians do: a ray meets some twenty of them.
    constexpr double kSize = 6;
    check_tree(tree, clumps(count, 0, 0, kSize));
    const Visits alone = visits_of(tree.copy());
    CHECK(alone.blocks > 1000);
    for (const double distance : {1e2, 1e4, 1e6, 1e7, 1e20}) {
      const Boxes boxes = clumps(count, 20, distance, kSize);
      check_tree(tree, boxes);
      const Visits visits = visits_of(tree.copy());
      CAPTURE(form);
      CAPTURE(distance);
      CHECK(double(visits.nodes) <= 1.5 * double(alone.nodes));
      CHECK(double(visits.blocks) <= 1.5 * double(alone.blocks));
      // Nearly all boxes have a high word of their own: sorting by it is enough.
      std::set<std::uint64_t> words;
      for (const std::uint64_t code : curve_codes(boxes)) words.insert(code >> 32);
      CHECK(words.size() > count / 2);
    }
  }
}

TEST_CASE("lbvh: a refit has the boxes of a rebuild and keeps the order") {
  Context context = make_test_context();
  for (const ChunkShape& shape : kShapes) {
    CAPTURE(shape.groups);
    CAPTURE(shape.group_size);
    Tree tree(context, TreeForm{8, false}, shape);
    for (const std::size_t count : {1u, 2u, 1500u}) {
      Boxes boxes = random_boxes(count, 0.1, 31);
      tree.build(boxes);
      const LbvhCopy built = tree.copy();
      tree.refit(boxes);
      CHECK(tree.copy().nodes == built.nodes);
      // Moved boxes, one of which vanishes: bounds follow, the order stays.
      boxes = random_boxes(count, 0.05, 32);
      if (count > 2) boxes[2] = {{1, 1, 1}, {-1, -1, -1}};
      tree.refit(boxes);
      const LbvhCopy refitted = tree.copy();
      CHECK(refitted.slots == built.slots);
      CHECK(validate_lbvh(refitted, boxes, LeafOrder::kAny) == "");
      if (count > 2) CHECK(validate_lbvh(refitted, boxes, LeafOrder::kCurve) != "");
    }
  }
}

TEST_CASE("lbvh: cost equals the sum over the nodes and tells an outdated order [small]") {
  Context context = make_test_context();
  for (const auto& [shape, form] : {std::pair{ChunkShape{3, 1, 16}, TreeForm{8, false}},
                                    {ChunkShape{2, 16, 16}, TreeForm{16, false}},
                                    {ChunkShape{2, 16, 16}, TreeForm{4, true}}}) {
    CAPTURE(form);
    Tree tree(context, form, shape);
    CHECK(tree.cost({}) == 0);
    Boxes boxes = random_boxes(700, 0.1, 41);
    // The window of the grid, to which boxes are clipped, holds them all.
    boxes[0] = box_at(-8, -8, -8, 0, 0, 0);
    boxes[1] = box_at(8, 8, 8, 0, 0, 0);
    boxes[5] = {{1, 1, 1}, {-1, -1, -1}};
    tree.build(boxes);
    const double built = tree.cost(boxes);
    CHECK(built == doctest::Approx(host_cost(tree.copy(), boxes)).epsilon(1e-5));
    // The same boxes in another order: refitted, the tree is far worse than built anew.
    const Boxes moved(boxes.rbegin(), boxes.rend());
    tree.refit(moved);
    CHECK(tree.cost(moved) > 1.5 * built);
    tree.build(moved);
    CHECK(tree.cost(moved) == doctest::Approx(built).epsilon(0.05));
  }
}

TEST_CASE("lbvh: the cost sees what happens among boxes when others are far away") {
  Context context = make_test_context();
  Tree tree(context, TreeForm{8, false}, ChunkShape::for_device(context.device()));
  const Boxes boxes = clumps(20000, 20, 1e6);
  tree.build(boxes);
  const double built = tree.cost(boxes);
  Boxes moved = boxes;
  CounterRng rng(3, 7);
  for (RsAabb& box : moved) {
    if (std::abs(box.lo[0]) > 2) continue;
    for (int a = 0; a < 3; ++a) {
      const auto by = static_cast<float>(0.1 * rng.normal());
      box.lo[a] += by;
      box.hi[a] += by;
    }
  }
  tree.refit(moved);
  CHECK(tree.cost(moved) > 1.5 * built);
}

TEST_CASE("lbvh: sizes that do not fit are refused") {
  Context context = make_test_context();
  Tree tree(context, TreeForm{4, false}, ChunkShape::for_device(context.device()));
  const Boxes boxes = random_boxes(10, 0.1, 1);
  CHECK_THROWS_AS(tree.lbvh().order(uploaded(context, boxes), 11), UsageError);
  tree.build(boxes);
  CHECK_THROWS_AS(tree.cost(random_boxes(9, 0.1, 1)), UsageError);
}

TEST_CASE("lbvh validation: a fault of each kind is found") {
  Context context = make_test_context();
  Tree tree(context, TreeForm{4, false}, ChunkShape::for_device(context.device()));
  Boxes boxes = random_boxes(1000, 0.1, 1);
  tree.build(boxes);
  const LbvhCopy sound = tree.copy();
  REQUIRE(validate_lbvh(sound, boxes) == "");
  REQUIRE(sound.level_sizes.size() >= 4);
  LbvhCopy faulty = sound;
  const auto fault = [&] { return validate_lbvh(faulty, boxes); };
  const auto has = [&](const char* part) { return fault().find(part) != std::string::npos; };
  SUBCASE("a box in two slots") {
    faulty.slots[17] = faulty.slots[400];
    CHECK(has("is in two slots"));
  }
  SUBCASE("a slot without a box") {
    faulty.slots[17] = 1000;
    CHECK(has("names box 1000 of 1000"));
  }
  SUBCASE("out of order") {
    std::swap(faulty.slots[17], faulty.slots[900]);
    CHECK(has("along the curve"));
  }
  SUBCASE("a block that leaves out a box") {
    boxes[sound.slots[50]].hi[1] += 9.0f;
    CHECK(validate_lbvh(sound, boxes, LeafOrder::kAny).find("of level 1") != std::string::npos);
  }
  SUBCASE("a node that leaves out a child, and one that is too large") {
    const std::size_t at = sound.at(sound.level_begin[2], 0, 0);
    faulty.nodes[at] = std::nextafter(faulty.nodes[at], 10.0f);
    CHECK(has("Child 0 of level 2"));
    faulty.nodes[at] = sound.nodes[at] - 1;
    CHECK(has("Child 0 of level 2"));
  }
  SUBCASE("a missing child that is not empty") {
    const std::size_t last = sound.level_sizes[0] - 1;
    REQUIRE(250 % sound.lanes != 0);  // blocks
    faulty.nodes[sound.at(last, 0, 3)] = 0;
    CHECK(has("the empty one of a missing child"));
  }
  SUBCASE("a level that begins elsewhere") {
    ++faulty.level_begin[2];
    CHECK(has("Level 2"));
  }
  SUBCASE("the scene's box") {
    faulty.nodes[sound.at(tree.lbvh().scene_node(), 0, 0)] -= 1;
    CHECK(has("the scene"));
  }
  SUBCASE("another number of boxes") {
    CHECK(validate_lbvh(sound, std::span<const RsAabb>(boxes).first(999)) != "");
  }
}

TEST_CASE("groups are ordered alike by one work-item and by many [small]") {
  Context context = make_test_context();
  for (const std::size_t count : {1u, 5u, 63u, 64u, 65u, 130u, 1000u}) {
    for (const int packet : {4, 8, 16}) {
      CAPTURE(count);
      CAPTURE(packet);
      Boxes boxes = random_boxes(count, 0.3, count);
      for (std::size_t i = 7; i < count; i += 11) boxes[i] = boxes[i - 1];
      for (std::size_t i = 3; i < count; i += 17) {
        boxes[i].lo[0] = std::numeric_limits<float>::quiet_NaN();
      }
      const Buffer<RsAabb> device_boxes = uploaded(context, boxes);
      std::vector<std::uint32_t> order(count);
      std::iota(order.rbegin(), order.rend(), 0u);
      BuildOptions build;
      build.define("LANES", packet).define("GROUP", 64);
      std::vector<std::vector<std::uint32_t>> results;
      for (const bool many : {false, true}) {
        Buffer<std::uint32_t> device_order(context, count, "order");
        device_order.upload(order);
        Kernel kernel = context.kernel(many ? "bvh/leaf_order_group.cl" : "bvh/leaf_order.cl",
                                       many ? "order_leaves_group" : "order_leaves", build);
        kernel.launch(many ? Range::linear(count, 64) : Range::linear((count + 63) / 64, 1),
                      device_boxes, device_order, static_cast<std::uint32_t>(count));
        results.push_back(device_order.download());
      }
      CHECK(results[0] == results[1]);
      if (count > 64) CHECK(results[0] != order);
    }
  }
}

TEST_CASE("lbvh: where an allocation fails the tree is empty, and may be made later") {
  Context context = make_test_context();
  const Boxes few = random_boxes(20, 0.3, 1), many = random_boxes(500, 0.3, 2);
  const Buffer<RsAabb> device_boxes = uploaded(context, many);
  bool failed = true;
  for (std::size_t n = 1; failed; ++n) {
    CAPTURE(n);
    Tree tree(context, TreeForm{4, false}, ChunkShape::for_device(context.device()));
    tree.build(few);
    failed = fails_at(context, n, [&] { tree.lbvh().order(device_boxes, many.size()); });
    if (failed) {
      CHECK(tree.lbvh().size() == 0);
      CHECK(tree.lbvh().levels() == 0);
    }
    check_tree(tree, many);
  }
}
