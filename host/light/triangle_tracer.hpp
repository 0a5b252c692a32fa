// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "bvh/lbvh.hpp"
#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/rays.hpp"
#include "raysplats/scene.hpp"
#include "shared/light_layout.h"
#include "trace/launch_budget.hpp"

namespace raysplats {

/// Traces rays against the triangles of meshes. Triangles are numbered through all meshes in order.
/// Watertight: a ray through an edge or corner that triangles share meets at least one of them.
class TriangleTracer {
 public:
  /// `launch_budget_ms` as in TraceOptions.
  explicit TriangleTracer(Context& context, double launch_budget_ms = -1.0);
  /// In another form than the device's tree_form(). Throws UsageError for one that there is not.
  TriangleTracer(Context& context, const TreeForm& form, double launch_budget_ms = -1.0);

  /// Builds the tree. Degenerate triangles are never met. Throws DataError for a position that is
  /// not finite and an index out of range.
  void build(std::span<const Mesh> meshes);
  std::size_t size() const { return tree_.size(); }

  /// The first triangle of each of the first `count` rays with t in (t_min, t_max], either side; of
  /// several at the same t the one with the lowest number. Enqueues and returns, unless launches
  /// are bounded.
  void nearest(const Buffer<Ray>& rays, std::size_t count, Buffer<RsSurfaceHit>& hits);
  /// The same; ray i does not meet the triangle paths[i].skip.
  void nearest(const Buffer<Ray>& rays,
               const Buffer<RsPath>& paths,
               std::size_t count,
               Buffer<RsSurfaceHit>& hits);

  /// passes[i] = product over the triangles that ray i crosses of 1 - shadow[triangle], without the
  /// triangle skip[i]; 1 for rays with t_max < t_min. Enqueues and returns.
  void light_through(const Buffer<Ray>& rays,
                     const Buffer<std::int32_t>& skip,
                     const Buffer<float>& shadow,
                     std::size_t count,
                     Buffer<float>& passes);

 private:
  template <class Skip>
  void launch_nearest(const Buffer<Ray>& rays,
                      const Skip& skip,
                      std::uint32_t skip_stride,
                      std::size_t count,
                      Buffer<RsSurfaceHit>& hits);
  template <class... Arguments>
  void launch_rays(const char* kernel, std::size_t count, const Arguments&... arguments);

  Context* context_;
  Lbvh tree_;
  LaunchBudget budget_;
  Buffer<float> corners_;
  Buffer<RsAabb> boxes_;
  Buffer<float> blocks_;
  Buffer<std::int32_t> no_skip_;
};

}  // namespace raysplats
