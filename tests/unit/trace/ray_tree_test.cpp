// SPDX-License-Identifier: Apache-2.0
#include "trace/ray_tree.hpp"

#include <doctest/doctest.h>

#include <bit>
#include <string>

#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "reference/scenes.hpp"
#include "trace/ray_tree_validate.hpp"
#include "unit/bvh/tree_forms.hpp"
#include "unit/failed_allocation.hpp"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

struct Fixture {
  Context context{test_device()};
  Gaussians model = reference::random_scene(700, 4, 1);
  TraceOptions options;

  DeviceGaussians uploaded(ScaleActivation activation = ScaleActivation::kExp) {
    return DeviceGaussians::upload(context, model, activation);
  }
  void shake(double by) {
    CounterRng rng(9, 2);
    for (float& mean : model.means) mean += static_cast<float>(by * rng.normal());
  }
};

}  // namespace

TEST_CASE("ray tree: a sound tree has no fault, built or refitted") {
  for (const auto& [adaptive, footprint] :
       {std::pair(false, 0.0f), std::pair(true, 0.0f), std::pair(true, 0.3f)}) {
    for (const TreeForm& form : test::kTreeForms) {
      Fixture f;
      f.options.adaptive_radius = adaptive;
      f.options.view_footprint = footprint;
      f.model.opacities[7] = -9;  // below 1/255
      RayTree tree(f.context, f.options, form);
      tree.build(f.uploaded());
      CHECK(validate_ray_tree(RayTreeCopy::of(tree), f.model) == "");
      f.shake(0.05);
      tree.refit(f.uploaded());
      CHECK(validate_ray_tree(RayTreeCopy::of(tree), f.model, LeafOrder::kAny) == "");
      // A model that a tree was not refitted to.
      f.shake(0.05);
      CHECK(validate_ray_tree(RayTreeCopy::of(tree), f.model, LeafOrder::kAny) != "");
    }
  }
}

TEST_CASE("ray tree: an empty model [small] [tiny]") {
  Fixture f;
  f.model.resize(0);
  RayTree tree(f.context, f.options, tree_form(test_device()));
  tree.build(f.uploaded());
  CHECK(validate_ray_tree(RayTreeCopy::of(tree), f.model) == "");
  CHECK(tree.follow(f.uploaded()));
}

TEST_CASE("ray tree: it is built anew when walking it has become dearer, and refitted otherwise") {
  Fixture f;
  RayTree tree(f.context, f.options, tree_form(test_device()));
  CHECK(tree.follow(f.uploaded()));
  for (int i = 0; i < 40; ++i) {
    f.shake(1e-4);
    CHECK(!tree.follow(f.uploaded()));
  }
  CHECK(validate_ray_tree(RayTreeCopy::of(tree), f.model, LeafOrder::kAny) == "");
  f.shake(1.0);
  CHECK(tree.follow(f.uploaded()));
  CHECK(validate_ray_tree(RayTreeCopy::of(tree), f.model) == "");
  CHECK(!tree.follow(f.uploaded()));
  // Growing Gaussians make every order dearer; that is no reason to order again.
  for (float& scale : f.model.log_scales) scale += 0.3f;
  CHECK(!tree.follow(f.uploaded()));
  f.model.resize(699);
  CHECK(tree.follow(f.uploaded()));
  CHECK(tree.tree().size() == 699);
}

TEST_CASE("ray tree: it is built anew for Gaussians that left the place where it was built") {
  Fixture f;
  RayTree tree(f.context, f.options, tree_form(test_device()));
  tree.build(f.uploaded());
  f.model = reference::random_scene(700, 5, 1);
  for (float& mean : f.model.means) mean += 50.0f;
  CHECK(tree.follow(f.uploaded()));
  CHECK(validate_ray_tree(RayTreeCopy::of(tree), f.model) == "");
  CHECK(!tree.follow(f.uploaded()));
}

TEST_CASE("ray tree: after a build that failed it is not refitted but built") {
  Fixture f;
  const DeviceGaussians former = f.uploaded();
  f.model = reference::random_scene(900, 5, 1);
  const DeviceGaussians next = f.uploaded();
  bool failed = true;
  for (std::size_t n = 1; failed; ++n) {
    CAPTURE(n);
    RayTree tree(f.context, f.options, tree_form(test_device()));
    CHECK_THROWS_AS(tree.refit(former), UsageError);
    tree.build(former);
    failed = fails_at(f.context, n, [&] { tree.build(next); });
    if (failed) {
      CHECK_THROWS_AS(tree.refit(next), UsageError);
      CHECK(tree.follow(next));
    }
    CHECK(validate_ray_tree(RayTreeCopy::of(tree), f.model) == "");
  }
}

TEST_CASE("ray tree validation: a fault of each kind is found") {
  Fixture f;
  RayTree tree(f.context, f.options, {8, false});
  tree.build(f.uploaded());
  RayTreeCopy copy = RayTreeCopy::of(tree);
  REQUIRE(validate_ray_tree(copy, f.model) == "");
  const auto has = [&](const std::string& part) {
    return validate_ray_tree(copy, f.model).find(part) != std::string::npos;
  };
  SUBCASE("a box that leaves out a part of its ellipsoid") {
    copy.boxes[5].hi[2] = f.model.means[5 * 3 + 2];
    CHECK(has("the box of Gaussian 5"));
  }
  SUBCASE("an empty box") {
    copy.boxes[5] = {{1, 1, 1}, {0, 0, 0}};
    CHECK(has("the box of Gaussian 5"));
  }
  SUBCASE("another Gaussian in a slot") {
    copy.blocks[copy.index_at(33)] = std::bit_cast<float>(7u + copy.tree.slots[33]);
    CHECK(has("slot 33 holds Gaussian"));
  }
  SUBCASE("a Gaussian at another place") {
    copy.blocks[copy.mean_at(33, 1)] += 1;
    CHECK(has("slot 33 has"));
  }
  SUBCASE("the tree over the boxes") {
    std::swap(copy.tree.slots[0], copy.tree.slots[1]);
    CHECK(validate_ray_tree(copy, f.model) != "");
    copy.tree.slots[0] = copy.tree.slots[1];
    CHECK(has("two slots"));
  }
  SUBCASE("another number of Gaussians") {
    f.model.resize(699);
    CHECK(has("over 700 Gaussians"));
  }
}
