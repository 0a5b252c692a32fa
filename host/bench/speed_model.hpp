// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace raysplats {

/// What the kernels of a row execute, work that finds nothing included: counted, not measured.
struct KernelWork {
  double vectors = 0;    ///< instructions on a whole vector or wave, but for the next four kinds
  double scalars = 0;    ///< instructions on one number for a whole vector or wave
  double slow = 0;       ///< divisions and roots of a vector or wave; GPUs: and exponentials
  double shifted = 0;    ///< vectors read that begin at any float
  double parked = 0;     ///< vectors written to memory that is near, most of them to be read again
  double bytes = 0;      ///< read and written in order
  double footprint = 0;  ///< bytes that these come from: which memory they can be in
  double lines = 0;      ///< of 64 bytes at random
  double runs = 0;       ///< of these lines in runs of about 16, which lie at random
  double table = 0;      ///< bytes that both come from
  double chases = 0;     ///< of these lines where the address of one is in the one before
  double path = 0;       ///< bytes that those come from
  double tiled = 0;      ///< lines of pictures, read tile by tile, of the footprint
  double stores = 0;     ///< of 8 bytes at random
  double targets = 0;    ///< bytes of the lines that they go to
  double local = 0;      ///< accesses of a wave to local memory
  double atomics = 0;    ///< floats added to shared memory
  double trips = 0;      ///< times that a wave waits for global memory
  double barriers = 0;   ///< of a wave
  double launches = 0;   ///< kernels
  double shared = 0;     ///< of these those whose work is worth sharing among processors

  KernelWork operator+(const KernelWork& other) const;
};

/// What a device does at best, measured or published.
struct DeviceSpeeds {
  /// Figures that hold up to so many bytes; the last one also beyond.
  struct Level {
    double bytes = 0;
    double per_second = 0;
  };

  std::string name;
  bool cpu = false;
  double vectors = 0;  ///< instructions a second
  double scalars = 0;  ///< 0: they take the slots of vectors
  double slow = 0;     ///< a second; their vectors' slots are not counted
  double shifted = 0;  ///< a second, of CPUs, like the next one
  double parked = 0;
  std::vector<Level> bandwidth;  ///< bytes a second
  std::vector<Level> lines;      ///< a second; none: by the bandwidth
  std::vector<Level> runs;       ///< a second; like the next two, none where there are no lines
  std::vector<Level> chases;
  std::vector<Level> tiled;
  std::vector<Level> stores;
  double processors = 1;    ///< of CPUs, like the next one
  double late_seconds = 0;  ///< that all processors but one come later to a launch
  double local = 0;         ///< accesses a second; 0: none apart
  double atomics = 0;       ///< a second; 0: none apart
  double clock = 0;         ///< Hz, of what follows
  double issue_cycles = 0;  ///< from an instruction to one that needs its result
  double trip_cycles = 0;   ///< of a wait for global memory
  double local_cycles = 0;  ///< of a wait for local memory or a barrier
  double launch_seconds = 0;
};

struct Prediction {
  double seconds = 0;
  std::string bound;  ///< "arithmetic", "memory", "local memory", "atomics", "latency", "launches"
};

/// The slowest of: instructions, bytes and lines, local accesses, additions, and the way of one
/// wave after the other through its instructions and waits where `resident` waves run at once (0:
/// not asked). Of a CPU the kinds of instructions add up, and lines and words at random,
/// which nothing fetches ahead, come on top, as do lines of tiles; so do launches, and on CPUs what
/// one processor does of each before the others come.
Prediction predict(const KernelWork& work, const DeviceSpeeds& device, double resident = 0);

/// A kernel as a vendor's compiler left it.
struct CompiledKernel {
  std::string target;
  std::string name;      ///< of the baseline
  double registers = 0;  ///< of a work-item
  double local = 0;      ///< bytes of a group
  double group = 0;      ///< work-items
  double width = 0;      ///< of a wave
};

/// The kernels that decide rows of run_bench() on GPUs, one per target.
const std::vector<CompiledKernel>& compiled_kernels();
/// The kernel of a row and target. Throws UsageError where there is none.
const CompiledKernel& compiled_kernel(const std::string& row, const std::string& target);

}  // namespace raysplats
