// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"
#include "synth/backdrop.hpp"
#include "synth/shapes.hpp"

namespace raysplats::synth {

/// How a surface answers light. Colours are linear.
struct Material {
  std::function<glm::dvec3(const glm::dvec3&)> albedo;  ///< of Shape::local()
  double specular = 0.0;                                ///< strength of the highlight
  double exponent = 32.0;                               ///< sharpness of the highlight (Blinn 1977)
  double translucency =
      0.0;  ///< share of the light on the far side of a thin plate that shines through
};

struct Object {
  std::unique_ptr<const Shape> shape;
  Material material;
};

/// Objects lit by one disc-shaped lamp and a sky that is brighter above.
class Scene {
 public:
  /// Without a backdrop rays that meet nothing are transparent.
  explicit Scene(std::vector<Object> objects, Backdrop backdrop = {});

  /// Displayed colour and coverage (0 or 1) along a ray; `lamp_sample` picks one of the
  /// kLampSamples points of the lamp, whose average gives a soft shadow.
  struct Sample {
    glm::dvec3 color{0.0};
    double alpha = 0.0;
  };
  static constexpr int kLampGrid = 3;
  static constexpr int kLampSamples = kLampGrid * kLampGrid;
  Sample trace(const Ray& ray, int lamp_sample) const;

 private:
  struct Bound {
    glm::dvec3 center;
    double squared_radius;
  };
  bool may_meet(const Bound& bound, const Ray& ray) const;
  bool occluded(const Ray& ray) const;
  glm::dvec3 shade(const Object& object,
                   const glm::dvec3& point,
                   const glm::dvec3& to_eye,
                   int lamp_sample) const;

  Sample behind(const Ray& ray) const;

  std::vector<Object> objects_;
  Backdrop backdrop_;
  std::vector<Bound> bounds_;
  Bound whole_;
  std::vector<glm::dvec3> lamp_points_;
};

/// The scene of the generator; `seed` varies its noise and its pebbles.
Scene make_still_life(std::uint64_t seed, Backdrop backdrop = {});

/// RGBA with straight alpha: kLampSamples samples on a grid in each pixel, averaged premultiplied.
Image render(const Scene& scene, const Camera& camera);

}  // namespace raysplats::synth
