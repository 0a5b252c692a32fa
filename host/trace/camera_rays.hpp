// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/camera.hpp"
#include "shared/layout.h"
#include "shared/ray_layout.h"
#include "trace/ray_tracer.hpp"

namespace raysplats {

/// Where rays through the centre of a pixel pass the lens.
struct Lens {
  std::uint32_t sample = 0;  ///< number of the sample: another one has other random numbers
  std::uint64_t seed = 0;
  float aperture = 0;  ///< radius of the lens, world units; rays are uniform over it, 0 = they
                       ///< pass its centre, as those of orthographic cameras do
  float focus_distance = 1;  ///< depth of what is sharp: along z for kPinhole and kOpenCv, else
                             ///< along the ray
};

/// The records of a camera that kernels read (cl/trace/lens.h): its model and the rest.
int camera_model_number(CameraModel model);
RsLensCamera lens_camera(const Camera& camera, const Lens& lens);

/// Throws ResourceError for a camera whose picture, four floats a pixel, fits in no buffer of the
/// device.
void require_room(const Camera& camera, const DeviceInfo& device);

/// Where rays of the camera take the colour of Gaussians from: seen from its centre, or along each
/// ray where there is none.
ColorDirection color_direction(const Camera& camera);

/// World direction along which the depths of a picture count; zero where they do along every ray.
std::array<float, 4> depth_axis(const Camera& camera);

/// Makes rays of pixels on the device, for every camera model (scene/camera/camera_model.hpp has
/// the same in double precision). Random numbers are functions of (seed, pixel, sample): dimensions
/// 0 and 1 place the ray on the lens (cl/shared/random.h).
class CameraRays {
 public:
  explicit CameraRays(Context& context) : context_(context) {}

  /// Writes the rays of the pixels [first_pixel, first_pixel + count), numbered row by row, into
  /// the first of `rays`, which grows when it is smaller: unit directions, t in [0, FLT_MAX]. A
  /// pixel that sees nothing gets an empty ray (t_max = -1), which RayTracer answers with the
  /// background. Enqueues and returns. Throws UsageError for pixels outside the picture.
  void generate(const Camera& camera,
                const Lens& lens,
                std::size_t first_pixel,
                std::size_t count,
                Buffer<Ray>& rays);
  /// Writes the cones of the first `count` of the camera's rays: `footprint` pixels wide, as the
  /// footprint of a view. Enqueues and returns.
  void cones(const Camera& camera,
             float footprint,
             const Buffer<Ray>& rays,
             std::size_t count,
             Buffer<RsCone>& cones);

 private:
  Context& context_;
};

}  // namespace raysplats
