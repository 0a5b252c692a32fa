// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "device/context.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"
#include "raysplats/pose_gradient.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// Whether forward() waits for the device to tell how much room a view needs.
enum class ViewSizes {
  kAwaited,  ///< and makes that room
  kAhead     ///< no: it takes the room of the views before, and overflow() tells where that was
             ///< too little. Waits all the same where no view was traced before, and where the
             ///< memory budget had too little room for the last one that was waited for.
};

/// Traces the rays of a central camera in packets (docs/model.md, "The camera line"), forward and
/// backward: a pinhole, or a lens whose tiles are seen by pinholes on the faces of a cube around it
/// (LensTiles).
class CameraTracer {
 public:
  struct Statistics {
    std::uint64_t capped_rays = 0;   ///< rays that stopped because of max_hits
    std::uint64_t candidates = 0;    ///< (tile, Gaussian) pairs tested
    std::uint64_t hits = 0;          ///< blended (ray, Gaussian) pairs
    std::uint64_t stream_bytes = 0;  ///< hit lists that keep_hits made or would have made
  };

  CameraTracer(Context& context, const TraceOptions& options);
  ~CameraTracer();

  /// Whether forward() takes a camera. Not an orthographic one, and not a small picture all around
  /// whose tiles see too much; may wait for the device when the lens is a new one.
  bool traces(const Camera& camera);

  /// Begins to make the programs that views of such Gaussians (their degrees and activation) take
  /// through the camera's kind of lens, with `keep_hits` those of gradients too, of depth as well
  /// with `depth_gradient`; does not wait for them. forward() does it as well.
  void begin_programs(const DeviceGaussians& gaussians,
                      const Camera& camera,
                      bool keep_hits,
                      bool depth_gradient);

  /// Boxes of the Gaussians as they are now. forward() needs it after every parameter change.
  void update(const DeviceGaussians& gaussians);

  /// Traces one view. With `keep_hits` the hit lists stay for backward() when they fit the memory
  /// budget and are recomputed there when they do not.
  void forward(const DeviceGaussians& gaussians,
               const Camera& camera,
               bool keep_hits = false,
               ViewSizes sizes = ViewSizes::kAwaited);
  /// Traces, from the next forward() without keep_hits on, the rows of tiles that are part `part`
  /// of `parts` equal ones, and leaves the others' pixels as they are. Whoever traces the parts
  /// gets the pixels of the whole.
  void set_share(std::size_t part, std::size_t parts);
  /// First and last (exclusive) row of pixels that the last forward() has traced.
  std::array<int, 2> rows() const;
  /// First and last (exclusive) row of this share of a picture of that height, without keep_hits.
  std::array<int, 2> shared_rows(int height) const;
  /// A word that is not 0 once a view with ViewSizes::kAhead had too little room: that view and
  /// those after it show the background alone and have no gradients, until clear_overflow().
  const Buffer<std::uint32_t>& overflow() const;
  void clear_overflow();

  /// The background of the views from the next forward() on.
  void set_background(const std::array<float, 3>& background);

  /// Lets `watch` hear, from the next forward() on, the share of the picture that is done after
  /// every launch, which then are short ones; what it throws ends forward(). Nothing is heard with
  /// {}.
  void set_watch(std::function<void(double share)> watch);

  /// Result of the last forward(): planar R, G, B (background blended), A = 1 - T; 4 x height x
  /// width.
  const Buffer<float>& image() const;
  /// Planar expected depth, median depth and hits per ray, with options.depth; 3 x height x width.
  /// Depth is along z for kPinhole and kOpenCv, along the ray for the others.
  const Buffer<float>& depth() const;
  /// The same as interleaved host images.
  Image download_image() const;
  Image download_depth() const;

  /// Gradients of the last forward(keep_hits = true) view from `image_gradient` (planar dL/dR,
  /// dL/dG, dL/dB, dL/dA; 4 x height x width). Overwrites `gradients`, growing its buffers as
  /// needed; with `pose` also the gradient for the pose of the view. `depth_gradient` adds that of
  /// depth: dL/dS per pixel (height x width) for the sum S of T alpha depth, of which the expected
  /// depth is S / A.
  void backward(const DeviceGaussians& gaussians,
                const Buffer<float>& image_gradient,
                GaussianGradients& gradients,
                PoseGradient* pose = nullptr,
                const Buffer<float>* depth_gradient = nullptr);

  /// What the last forward() counted; waits for the device unless that one kept its hits and waited
  /// itself.
  Statistics statistics() const;
  /// Lets kernels count, from the next forward() on, what they really do, RS_TALLIES kinds of work
  /// (cl/trace/view_sizes.h), for the model of speed; they are then slower. Read after forward(),
  /// waits for the device; empty without count_work().
  void count_work();
  std::vector<std::uint64_t> work() const;
  /// The statistics on the device: RS_COUNT_WORDS words (cl/trace/view_sizes.h).
  const Buffer<std::uint32_t>& counters() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
