// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <filesystem>

#include "raysplats/gaussians.hpp"
#include "raysplats/train_options.hpp"
#include "synth/synthetic_dataset.hpp"

namespace raysplats {

/// A run that reports its end alone.
inline TrainOptions short_training(int iterations) {
  TrainOptions options;
  options.iterations = iterations;
  options.eval_at = {};
  options.save_at = {};
  options.eval_renders = 0;
  options.checkpoint_every = 0;
  return options;
}

inline void check_equal(const Gaussians& a, const Gaussians& b) {
  CHECK(a.means == b.means);
  CHECK(a.quaternions == b.quaternions);
  CHECK(a.log_scales == b.log_scales);
  CHECK(a.opacities == b.opacities);
  CHECK(a.sh == b.sh);
}

/// Small generated photos in `folder`, which is made.
inline void make_photos(const std::filesystem::path& folder,
                        int size,
                        int train_views,
                        int test_views,
                        SyntheticScene scene = SyntheticScene::kStillLife) {
  SyntheticOptions options;
  options.scene = scene;
  options.size = size;
  options.train_views = train_views;
  options.test_views = test_views;
  generate_dataset(folder, options, false);
}

}  // namespace raysplats
