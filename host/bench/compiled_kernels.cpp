// SPDX-License-Identifier: Apache-2.0
// Written by scripts/gpu_compile.py --write-baseline, from scripts/gpu/baseline.json.
#include "bench/speed_model.hpp"

namespace raysplats {

const std::vector<CompiledKernel>& compiled_kernels() {
  static const std::vector<CompiledKernel> all{
      {"gfx1100", "sort pairs: scatter", 42, 15424, 256, 32},
      {"gfx1100", "prepare sh0: prepare_view", 60, 4096, 64, 32},
      {"gfx1100", "lists: fill_tiles", 55, 0, 64, 32},
      {"gfx1100", "group forward render: trace_forward_group", 41, 7952, 32, 32},
      {"gfx1100", "group forward train: trace_forward_group", 44, 7960, 32, 32},
      {"gfx1100", "group backward atomic: trace_backward_group", 71, 7712, 32, 32},
      {"gfx1100", "finalize group sh3: finalize_group", 75, 4096, 64, 32},
      {"gfx1100", "loss group: group_ssim_derivatives", 55, 12064, 256, 32},
      {"gfx1100", "loss group: group_gradient", 39, 13104, 256, 32},
      {"gfx1100", "adam sh3: adam_step", 20, 0, 64, 32},
      {"gfx1100", "rays: trace_rays", 71, 7936, 64, 32},
      {"dg2-g10", "sort pairs: scatter", 128, 15424, 256, 16},
      {"dg2-g10", "prepare sh0: prepare_view", 128, 4096, 64, 16},
      {"dg2-g10", "lists: fill_tiles", 128, 0, 64, 16},
      {"dg2-g10", "group forward render: trace_forward_group", 128, 7968, 32, 16},
      {"dg2-g10", "group forward train: trace_forward_group", 128, 7968, 32, 16},
      {"dg2-g10", "group backward atomic: trace_backward_group", 128, 7712, 32, 16},
      {"dg2-g10", "finalize group sh3: finalize_group", 128, 4096, 64, 16},
      {"dg2-g10", "loss group: group_ssim_derivatives", 128, 12064, 256, 32},
      {"dg2-g10", "loss group: group_gradient", 128, 13120, 256, 32},
      {"dg2-g10", "adam sh3: adam_step", 128, 0, 64, 16},
      {"dg2-g10", "rays: trace_rays", 128, 7936, 64, 16},
      {"sm_86", "sort pairs: scatter", 40, 15424, 256, 32},
      {"sm_86", "prepare sh0: prepare_view", 46, 4096, 64, 32},
      {"sm_86", "lists: fill_tiles", 59, 0, 64, 32},
      {"sm_86", "group forward render: trace_forward_group", 53, 7952, 32, 32},
      {"sm_86", "group forward train: trace_forward_group", 56, 7960, 32, 32},
      {"sm_86", "group backward atomic: trace_backward_group", 64, 7712, 32, 32},
      {"sm_86", "finalize group sh3: finalize_group", 64, 4096, 64, 32},
      {"sm_86", "loss group: group_ssim_derivatives", 58, 12064, 256, 32},
      {"sm_86", "loss group: group_gradient", 40, 13104, 256, 32},
      {"sm_86", "adam sh3: adam_step", 40, 0, 64, 32},
      {"sm_86", "rays: trace_rays", 64, 7936, 64, 32},
      {"sm_90", "sort pairs: scatter", 32, 15424, 256, 32},
      {"sm_90", "prepare sh0: prepare_view", 46, 4096, 64, 32},
      {"sm_90", "lists: fill_tiles", 62, 0, 64, 32},
      {"sm_90", "group forward render: trace_forward_group", 55, 7952, 32, 32},
      {"sm_90", "group forward train: trace_forward_group", 63, 7960, 32, 32},
      {"sm_90", "group backward atomic: trace_backward_group", 64, 7712, 32, 32},
      {"sm_90", "finalize group sh3: finalize_group", 64, 4096, 64, 32},
      {"sm_90", "loss group: group_ssim_derivatives", 58, 12064, 256, 32},
      {"sm_90", "loss group: group_gradient", 32, 13104, 256, 32},
      {"sm_90", "adam sh3: adam_step", 40, 0, 64, 32},
      {"sm_90", "rays: trace_rays", 64, 7936, 64, 32}};
  return all;
}

}  // namespace raysplats
