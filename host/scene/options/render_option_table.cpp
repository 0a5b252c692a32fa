// SPDX-License-Identifier: Apache-2.0
#include "scene/options/render_option_table.hpp"

namespace raysplats {

std::vector<OptionRow> render_option_rows(RenderSettings& s) {
  OptionTable t;
  t.number("samples", s.samples, 1, 65536, "rays per pixel");
  t.number("max-bounces", s.max_bounces, 1, 1000, "surfaces that a path may meet");
  t.number("min-throughput", s.min_throughput, 0, 1,
           "a path that carries less ends; no pixel is darker by more");
  t.number("seed", s.seed, 0, kMaxSeed, "of everything that is random");
  t.color("ambient", s.ambient, "light on diffuse surfaces besides lights and environment",
          kMaxColor);
  t.flag("indirect", s.indirect, "diffuse surfaces gather light by rays instead of 'ambient'");
  t.number("light-samples", s.light_samples, 1, 1024, "shadow rays per sphere light");
  t.number("aperture", s.aperture, 0, kNoBound,
           "radius of the lens in world units; 0 = everything is sharp");
  t.number("focus-distance", s.focus_distance, 1e-9, kNoBound, "depth of what is sharp");
  t.number("bias", s.bias, 0, kNoBound,
           "start of shadow rays from Gaussians; 0 = 1/1000 of their size");
  return t.take();
}

std::vector<OptionRow> shadow_option_rows(ShadowSettings& s) {
  OptionTable t;
  t.flag("mesh-on-mesh", s.mesh_on_mesh, "meshes shade meshes");
  t.flag("mesh-on-gaussians", s.mesh_on_gaussians, "meshes shade Gaussians");
  t.flag("gaussians-on-mesh", s.gaussians_on_mesh, "Gaussians shade meshes");
  t.flag("gaussians-on-gaussians", s.gaussians_on_gaussians, "Gaussians shade Gaussians");
  t.number("strength", s.strength, 0, 1, "darkness where no light comes");
  return t.take();
}

void check_render_settings(RenderSettings settings) {
  check_values(render_option_rows(settings));
  check_values(shadow_option_rows(settings.shadows));
}

}  // namespace raysplats
