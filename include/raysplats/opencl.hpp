// SPDX-License-Identifier: Apache-2.0
#pragma once

// For programs with OpenCL of their own: their queue, and their buffers in and out without a way
// through the host.

#include <cstddef>
#include <memory>

#include "raysplats/context.hpp"
#include "raysplats/model.hpp"
#include "raysplats/rays.hpp"
#include "raysplats/tracer.hpp"

// The names of the OpenCL headers, which whoever has a queue has included.
typedef struct _cl_command_queue* cl_command_queue;  // NOLINT(bugprone-reserved-identifier)
typedef struct _cl_mem* cl_mem;                      // NOLINT(bugprone-reserved-identifier)

namespace raysplats {

/// A context that works on a queue of the caller's, which it retains: its launches stand in that
/// queue between the caller's own, in order. Throws UsageError for a queue that is out of order or,
/// with options.profile, takes no times, and DeviceError for a device that list_devices() does not
/// know or that is not usable.
std::unique_ptr<Context> make_context(cl_command_queue queue, const ContextOptions& options = {});

/// The queue of a context, of either kind; the context keeps it.
cl_command_queue opencl_queue(Context& context);

/// Parameters of Gaussians in buffers of floats, laid out and before activation as in Gaussians.
struct GaussianBuffers {
  cl_mem means = nullptr;        ///< 3 N
  cl_mem quaternions = nullptr;  ///< 4 N
  cl_mem log_scales = nullptr;   ///< 3 N
  cl_mem opacities = nullptr;    ///< N
  cl_mem sh = nullptr;           ///< N x coefficients x 3
};

/// Copies buffers into a model, whose number of Gaussians and SH degree stay: it has another
/// revision() then. Enqueues and returns; the numbers are the caller's responsibility. Throws
/// UsageError for a buffer that is missing, too small or of another cl_context.
void copy_gaussians(const GaussianBuffers& source, Model& target);

/// The other way round. Throws as that does.
void copy_gaussians(const Model& source, const GaussianBuffers& target);

/// Tracer::trace() of the first `count` rays (Ray) of a buffer into a buffer of RayResult. Enqueues
/// and returns, and checks no ray: one that Tracer::trace() would refuse has a result without
/// meaning. Throws UsageError for buffers that are missing, too small or of another cl_context, and
/// as Tracer::trace() for model and options.
void trace(Tracer& tracer,
           const Model& model,
           cl_mem rays,
           std::size_t count,
           cl_mem results,
           ColorDirection direction = ColorDirection::kRay);

}  // namespace raysplats
