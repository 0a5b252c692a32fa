// SPDX-License-Identifier: Apache-2.0
#include "run/dataset_fingerprint.hpp"

#include <doctest/doctest.h>

#include <fstream>

#include "unit/temporary_directory.hpp"

using namespace raysplats;

TEST_CASE("other depth maps are other data where depths are trained on") {
  const TemporaryDirectory folder;
  Dataset dataset;
  dataset.views.resize(1);
  const std::string bare = dataset_fingerprint(dataset);
  CHECK(dataset_fingerprint(dataset, true) == bare);

  dataset.views[0].depth_path = folder.path() / "depth.npy";
  std::ofstream(dataset.views[0].depth_path) << "near";
  const std::string near = dataset_fingerprint(dataset, true);
  CHECK(near != bare);
  CHECK(dataset_fingerprint(dataset) == bare);

  // Of the same size.
  std::ofstream(dataset.views[0].depth_path) << "afar";
  CHECK(dataset_fingerprint(dataset, true) != near);
  std::ofstream(dataset.views[0].depth_path) << "near";
  CHECK(dataset_fingerprint(dataset, true) == near);
}
