// SPDX-License-Identifier: Apache-2.0
#include "side_by_side.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/matrix.hpp>

#include "trace/camera_tracer.hpp"
#include "trace/ray_tracer.hpp"

namespace raysplats::peer {

namespace {

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void compare(Result& result, const std::vector<std::array<float, 3>>& expected) {
  double sum = 0.0, difference = 0.0;
  const auto& colors = result.last.colors;
  for (std::size_t i = 0; i < colors.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double off = std::abs(double(colors[i][k]) - expected[i][k]);
      sum += colors[i][k];
      difference += off;
      result.max_difference = std::max(result.max_difference, off);
    }
  }
  const double values = 3.0 * static_cast<double>(std::max<std::size_t>(1, colors.size()));
  result.mean_color = sum / values;
  result.mean_difference = difference / values;
}

}  // namespace

std::vector<Result> run_in_turn(const std::vector<Contestant>& contestants, int repeat) {
  std::vector<Result> results(contestants.size());
  std::vector<std::vector<double>> times(contestants.size());
  for (int round = 0; round <= repeat; ++round) {
    for (std::size_t i = 0; i < contestants.size(); ++i) {
      results[i].last = contestants[i].run();
      if (round > 0) times[i].push_back(1e3 * results[i].last.seconds);
    }
  }
  for (std::size_t i = 0; i < contestants.size(); ++i) {
    std::sort(times[i].begin(), times[i].end());
    const std::size_t n = times[i].size();
    results[i].name = contestants[i].name;
    results[i].min_ms = times[i].front();
    results[i].median_ms = 0.5 * (times[i][(n - 1) / 2] + times[i][n / 2]);
    compare(results[i], results.front().last.colors);
  }
  return results;
}

CameraRays camera_rays(const Camera& camera) {
  constexpr int kTile = 16, kPacket = 4;
  CameraRays out;
  const glm::dvec3 center = camera.center();
  const glm::dmat3 to_world = glm::transpose(camera.rotation);
  const auto add = [&](int column, int row) {
    const bool inside = column < camera.width && row < camera.height;
    column = std::min(column, camera.width - 1);
    row = std::min(row, camera.height - 1);
    const glm::dvec3 direction = to_world * glm::dvec3((column + 0.5 - camera.cx) / camera.fx,
                                                       (row + 0.5 - camera.cy) / camera.fy, 1.0);
    Ray ray{};
    for (int k = 0; k < 3; ++k) {
      ray.origin[k] = static_cast<float>(center[k]);
      ray.direction[k] = static_cast<float>(direction[k]);
    }
    ray.t_max = 1e30f;
    out.rays.push_back(ray);
    out.pixels.push_back(inside ? static_cast<std::size_t>(row) *
                                          static_cast<std::size_t>(camera.width) +
                                      static_cast<std::size_t>(column)
                                : CameraRays::npos);
  };
  for (int tile_y = 0; tile_y < camera.height; tile_y += kTile) {
    for (int tile_x = 0; tile_x < camera.width; tile_x += kTile) {
      for (int packet = 0; packet < kTile * kTile / (kPacket * kPacket); ++packet) {
        const int x = tile_x + kPacket * (packet % (kTile / kPacket));
        const int y = tile_y + kPacket * (packet / (kTile / kPacket));
        if (x >= camera.width || y >= camera.height) continue;
        for (int i = 0; i < kPacket * kPacket; ++i) add(x + i % kPacket, y + i / kPacket);
      }
    }
  }
  return out;
}

struct OurTracer::Impl {
  Impl(const std::string& selector, const Gaussians& model, const TraceOptions& options)
      : context(select_device(selector)),
        gaussians(DeviceGaussians::upload(context, model, ScaleActivation::kExp)),
        camera_tracer(context, options),
        ray_tracer(context, options) {}

  Context context;
  DeviceGaussians gaussians;
  CameraTracer camera_tracer;
  RayTracer ray_tracer;
  bool camera_ready = false;
  bool rays_ready = false;
};

OurTracer::OurTracer(const std::string& device, const Gaussians& model, const TraceOptions& options)
    : impl_(std::make_unique<Impl>(device, model, options)) {}

OurTracer::~OurTracer() = default;

std::string OurTracer::device_name() const { return impl_->context.device().name; }

Outcome OurTracer::camera(const Camera& camera) {
  Impl& my = *impl_;
  if (!my.camera_ready) my.camera_tracer.update(my.gaussians);
  my.camera_ready = true;
  my.context.finish();
  Outcome outcome;
  outcome.seconds = seconds_of([&] {
    my.camera_tracer.forward(my.gaussians, camera);
    my.context.finish();
  });
  const Image image = my.camera_tracer.download_image();
  outcome.colors.resize(image.pixels());
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const float* pixel = image.data.data() + i * static_cast<std::size_t>(image.channels);
    outcome.colors[i] = {pixel[0], pixel[1], pixel[2]};
  }
  outcome.hits_per_ray =
      static_cast<double>(my.camera_tracer.statistics().hits) / static_cast<double>(image.pixels());
  return outcome;
}

Outcome OurTracer::rays(std::span<const Ray> rays) {
  Impl& my = *impl_;
  if (!my.rays_ready) my.ray_tracer.update(my.gaussians);
  my.rays_ready = true;
  my.context.finish();
  std::vector<RayResult> results;
  Outcome outcome;
  outcome.seconds = seconds_of([&] { results = my.ray_tracer.trace(my.gaussians, rays); });
  double hits = 0.0;
  for (const RayResult& result : results) {
    outcome.colors.push_back({result.color[0], result.color[1], result.color[2]});
    hits += result.hits;
  }
  outcome.hits_per_ray = hits / static_cast<double>(results.size());
  return outcome;
}

Outcome OurTracer::build() {
  Impl& my = *impl_;
  Outcome outcome;
  outcome.seconds = seconds_of([&] {
    my.ray_tracer.update(my.gaussians);
    my.context.finish();
  });
  my.rays_ready = true;
  return outcome;
}

Outcome OurTracer::refit() {
  Impl& my = *impl_;
  if (!my.rays_ready) build();
  Outcome outcome;
  outcome.seconds = seconds_of([&] {
    my.ray_tracer.refit(my.gaussians);
    my.context.finish();
  });
  return outcome;
}

}  // namespace raysplats::peer
