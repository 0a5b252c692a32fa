// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

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
