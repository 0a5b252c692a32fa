// SPDX-License-Identifier: Apache-2.0
// Uses the installed library from outside: every public header, a device query and a file written
// and read back.
#include <raysplats/camera.hpp>
#include <raysplats/context.hpp>
#include <raysplats/dataset.hpp>
#include <raysplats/device.hpp>
#include <raysplats/error.hpp>
#include <raysplats/evaluation.hpp>
#include <raysplats/gaussians.hpp>
#include <raysplats/image.hpp>
#include <raysplats/io.hpp>
#include <raysplats/lpips.hpp>
#include <raysplats/model.hpp>
#include <raysplats/path_tracer.hpp>
#include <raysplats/pose_gradient.hpp>
#include <raysplats/rays.hpp>
#include <raysplats/scene.hpp>
#include <raysplats/trace_options.hpp>
#include <raysplats/tracer.hpp>
#include <raysplats/train_options.hpp>
#include <raysplats/trainer.hpp>

#include <cstdio>
#include <vector>

int main() {
  try {
    const std::vector<raysplats::DeviceInfo> devices = raysplats::list_devices();
    std::printf("%zu OpenCL devices\n", devices.size());
    for (const raysplats::DeviceInfo& device : devices) {
      std::printf("  %zu: %s (%s)\n", device.index, device.name.c_str(), device.platform.c_str());
    }
    raysplats::Gaussians model;
    model.resize(3);
    raysplats::write_ply("consumer.ply", model);
    return raysplats::read_ply("consumer.ply").size() == 3 ? 0 : 1;
  } catch (const raysplats::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return error.exit_code();
  }
}
