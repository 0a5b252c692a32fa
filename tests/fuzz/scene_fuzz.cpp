// SPDX-License-Identifier: Apache-2.0
// A scene file beside the files that the seeds name, loaded when it is understood.
#include <string_view>

#include "fuzz/fuzz_target.hpp"
#include "io/scene/scene_file.hpp"
#include "io/scene/scene_loader.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/image.hpp"
#include "raysplats/io.hpp"

namespace raysplats::fuzz {
namespace {

constexpr std::string_view kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

void write_companions() {
  Gaussians model;
  model.resize(1);
  model.quaternions[0] = 1.0f;
  write_ply(scratch().path() / "model.ply", model);
  write_image(scratch().path() / "image.png", Image(2, 2, 3, 0.5f));
  scratch().write("mesh.obj",
                  {reinterpret_cast<const std::uint8_t*>(kTriangle.data()), kTriangle.size()});
}

void parse(std::span<const std::uint8_t> input) {
  static const bool written = (write_companions(), true);
  static_cast<void>(written);
  load_scene(read_scene_file(scratch().write("scene.toml", input)));
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
