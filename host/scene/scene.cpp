// SPDX-License-Identifier: Apache-2.0
#include "raysplats/scene.hpp"

namespace raysplats {

float shadow_opacity(const Material& material) {
  if (material.shadow) return *material.shadow;
  switch (material.kind) {
    case Material::Kind::kTransparent:
      return material.opacity;
    case Material::Kind::kGlass:
      return 0.2f;
    case Material::Kind::kEmissive:
      return 0.0f;
    case Material::Kind::kDiffuse:
    case Material::Kind::kMirror:
      break;
  }
  return 1.0f;
}

}  // namespace raysplats
