// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>

#include "device/buffer.hpp"
#include "device/context.hpp"

// Names as the OpenCL headers have them.
typedef struct _cl_command_queue* cl_command_queue;  // NOLINT(bugprone-reserved-identifier)
typedef struct _cl_mem* cl_mem;                      // NOLINT(bugprone-reserved-identifier)

namespace raysplats {

/// A context on a caller's queue, and the queue of a context; see raysplats/opencl.hpp.
std::unique_ptr<Context> adopt_queue(cl_command_queue queue, const ContextOptions& options);
cl_command_queue queue_of(Context& context);

/// Throws UsageError for a caller's buffer that is missing, smaller than `bytes` or of another
/// cl_context. `what` names it ("the means").
void check_foreign(Context& context, cl_mem memory, std::size_t bytes, const char* what);

/// Copies `bytes` of a caller's buffer into one of the library's, or the other way round; enqueues
/// and returns. `what` names the caller's ("the means"). Throws UsageError when it is missing, too
/// small or of another cl_context.
void copy_in(
    Context& context, cl_mem source, const RawBuffer& target, std::size_t bytes, const char* what);
void copy_out(
    Context& context, const RawBuffer& source, cl_mem target, std::size_t bytes, const char* what);

}  // namespace raysplats
