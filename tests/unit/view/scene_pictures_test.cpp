// SPDX-License-Identifier: Apache-2.0
// What the page shows of a scene file, sample by sample.
#include <cmath>
#include <cstdint>
#include <memory>

#include "unit/light/light_fixture.hpp"
#include "view/picture_source.hpp"

using namespace raysplats;
using namespace raysplats::view;
using reference::ball;
using reference::white;

namespace {

/// How alike the colours of two pictures are, as PSNR in decibels.
double likeness(const Image& a, const Image& b) {
  REQUIRE(a.data.size() == b.data.size());
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    const double d = static_cast<double>(a.data[i]) - b.data[i];
    if (i % 4 < 3) sum += d * d;
  }
  return -10.0 * std::log10(sum / (3.0 * static_cast<double>(a.pixels())) + 1e-12);
}

Image mean(PictureSource& pictures, bool moving, std::uint64_t samples) {
  ViewRequest request;
  request.camera = kCamera;
  request.moving = moving;
  Image out(kCamera.width, kCamera.height, 4);
  for (std::uint64_t sample = 0; sample < samples; ++sample) {
    const Image picture = pictures.draw(request, sample, {});
    REQUIRE(picture.data.size() == out.data.size());
    for (std::size_t i = 0; i < out.data.size(); ++i)
      out.data[i] += picture.data[i] / static_cast<float>(samples);
  }
  return out;
}

/// The page's samples against a picture of many, which has what one sample alone leaves out.
void check_samples(Context& context, Scene scene) {
  const std::unique_ptr<MeshPictures> pictures = scene_pictures(context, scene);
  const std::uint64_t samples = pictures->samples();
  scene.render.samples = 256;
  const Image many = render_on_device(context, scene, kCamera);
  const double few = likeness(mean(*pictures, false, samples / 8), many);
  const double all = likeness(mean(*pictures, false, samples), many);
  const double sharp = likeness(mean(*pictures, true, samples), many);
  MESSAGE("an eighth of the samples ", few, " dB, all ", all, " dB, sharp ones ", sharp, " dB");
  CHECK(all > 27.0);
  CHECK(all > few + 4.0);
  CHECK(all > sharp + 8.0);
}

Image stripes(int width, int height, int period) {
  Image out(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) out.at(x, y, c) = 2 * (x % period) < period ? 1.0f : 0.0f;
    }
  }
  return out;
}

}  // namespace

TEST_CASE("samples of a still page become the picture of a rough mirror") {
  Context context = make_test_context();
  Scene scene = cloud_scene();
  scene.environment.equirect = stripes(64, 32, 8);
  Material rough = white(Material::Kind::kMirror);
  rough.roughness = 0.6f;
  add_mesh(scene, ball({0, 0, 0}, 1.2, 16, 0, true), rough);
  check_samples(context, std::move(scene));
}

TEST_CASE("samples of a still page become the picture of an open lens") {
  Context context = make_test_context();
  Scene scene = cloud_scene();
  // Gaussians alone, far from what is sharp: packets, whose rays leave one point, would show them
  // so.
  scene.environment.color = {0, 0, 0};
  scene.render.aperture = 0.5f;
  scene.render.focus_distance = 1.5f;
  for (float& opacity : scene.gaussians.opacities) opacity = 5.0f;
  check_samples(context, std::move(scene));
}
