// SPDX-License-Identifier: Apache-2.0
#include "embree_tracer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <thread>

#include "k_buffer.hpp"
#include "raysplats/error.hpp"

namespace raysplats::peer {

namespace {

constexpr int kLanes = 16;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// What a traversal hands to the intersect callback, behind Embree's own context.
struct TraversalContext {
  RTCIntersectContext embree;  ///< first: Embree passes its address on
  void (*intersect)(const TraversalContext&, const RTCIntersectFunctionNArguments*);
  const EmbreeGaussian* gaussians;
  float quantile;
  float min_transmittance;
  void* buffers;  ///< KBuffer of the ray, or of each of the packet's rays
};

/// e^x for x in [-80, 0], relative error 7e-7, in code that compilers vectorise.
inline float exponential(float x) {
  const float y = x * 1.44269504f;
  const int whole = static_cast<int>(y - 1.0f);  // towards zero: y - whole lies in [0, 1]
  const float f = (y - static_cast<float>(whole)) * 0.69314718f;
  const float p =
      1.0f + f * (1.0f + f * (0.5f + f * (1.66666667e-1f +
                                          f * (4.16666667e-2f +
                                               f * (8.33333333e-3f +
                                                    f * (1.38888889e-3f + f * 1.98412698e-4f))))));
  return p * std::bit_cast<float>((whole + 127) << 23);
}

/// The line of a ray relative to a Gaussian (docs/model.md, "A ray meets a Gaussian").
struct Meeting {
  float peak;     ///< t of the maximum response
  float delta;    ///< squared whitened distance
  float inverse;  ///< 1 / <d', d'>

  /// Where delta <= quantile.
  float near_root(float quantile) const {
    return peak - std::sqrt(std::max(0.0f, quantile - delta) * inverse);
  }
};

inline Meeting meet(
    const EmbreeGaussian& g, float ox, float oy, float oz, float dx, float dy, float dz) {
  const float* m = g.rows;
  const float px = ox - g.mean[0], py = oy - g.mean[1], pz = oz - g.mean[2];
  const float ax = m[0] * px + m[1] * py + m[2] * pz;
  const float ay = m[3] * px + m[4] * py + m[5] * pz;
  const float az = m[6] * px + m[7] * py + m[8] * pz;
  const float bx = m[0] * dx + m[1] * dy + m[2] * dz;
  const float by = m[3] * dx + m[4] * dy + m[5] * dz;
  const float bz = m[6] * dx + m[7] * dy + m[8] * dz;
  const float inverse = 1.0f / (bx * bx + by * by + bz * bz);
  const float peak = -(ax * bx + ay * by + az * bz) * inverse;
  const float vx = ax + peak * bx, vy = ay + peak * by, vz = az + peak * bz;
  return {peak, vx * vx + vy * vy + vz * vz, inverse};
}

template <int Capacity>
void put(KBuffer<Capacity>& buffer, std::uint64_t key, float alpha, float& t_far) {
  buffer.insert(key, alpha);
  // The next float keeps hits of equal depth and lower index.
  if (buffer.full()) {
    t_far = std::bit_cast<float>(std::bit_cast<std::uint32_t>(buffer.last_t()) + 1);
  }
}

template <int Capacity>
void intersect_single(const TraversalContext& context, const RTCIntersectFunctionNArguments* args) {
  RTCRay& ray = reinterpret_cast<RTCRayHit*>(args->rayhit)->ray;
  const EmbreeGaussian& g = context.gaussians[args->primID];
  const Meeting hit = meet(g, ray.org_x, ray.org_y, ray.org_z, ray.dir_x, ray.dir_y, ray.dir_z);
  if (!(hit.delta <= context.quantile)) return;
  const float t = hit.near_root(context.quantile);
  if (!(t >= ray.tnear && t <= ray.tfar)) return;
  auto& buffer = *static_cast<KBuffer<Capacity>*>(context.buffers);
  const std::uint64_t key = KBuffer<Capacity>::key_of(t, args->primID);
  if (!buffer.wants(key)) return;
  put(buffer, key, g.opacity * exponential(-0.5f * hit.delta), ray.tfar);
}

template <int Capacity>
void intersect_packet(const TraversalContext& context, const RTCIntersectFunctionNArguments* args) {
  RTCRay16& ray = reinterpret_cast<RTCRayHit16*>(args->rayhit)->ray;
  const EmbreeGaussian g = context.gaussians[args->primID];
  alignas(64) float t[kLanes], alpha[kLanes];
  alignas(64) int met[kLanes];
  const int* valid = args->valid;
  int any = 0;
#pragma GCC ivdep
  for (int i = 0; i < kLanes; ++i) {
    const Meeting hit =
        meet(g, ray.org_x[i], ray.org_y[i], ray.org_z[i], ray.dir_x[i], ray.dir_y[i], ray.dir_z[i]);
    t[i] = hit.near_root(context.quantile);
    alpha[i] = g.opacity * exponential(-0.5f * std::min(hit.delta, context.quantile));
    met[i] = (hit.delta <= context.quantile) & (t[i] >= ray.tnear[i]) & (t[i] <= ray.tfar[i]) &
             (valid[i] != 0);
    any |= met[i] << i;
  }
  auto* buffers = static_cast<KBuffer<Capacity>*>(context.buffers);
  for (unsigned lanes = static_cast<unsigned>(any); lanes != 0; lanes &= lanes - 1) {
    const int i = std::countr_zero(lanes);
    const std::uint64_t key = KBuffer<Capacity>::key_of(t[i], args->primID);
    if (buffers[i].wants(key)) {
      put(buffers[i], key, alpha[i], ray.tfar[i]);
    }
  }
}

/// Colour and transmittance of a ray on its way.
struct Blend {
  using Color = float __attribute__((vector_size(16)));
  Color color{};
  float transmittance = 1.0f;
  std::uint32_t hits = 0;
  std::uint32_t traces = 0;

  /// Blends what a traversal gathered; true when the ray has ended.
  template <int Capacity>
  bool add(const KBuffer<Capacity>& buffer, const TraversalContext& context) {
    ++traces;
    for (int i = 0; i < buffer.size(); ++i) {
      const float* rgb = context.gaussians[buffer.index(i)].rgb;
      const float alpha = buffer.alpha(i);
      const Color rgba = {rgb[0], rgb[1], rgb[2], 0.0f};
      color += transmittance * alpha * rgba;
      transmittance *= 1.0f - alpha;
      ++hits;
      if (transmittance < context.min_transmittance) return true;
    }
    return !buffer.full();
  }
  EmbreeResult result() const {
    return {{color[0], color[1], color[2]}, transmittance, hits, traces};
  }
};

void start(TraversalContext& context, EmbreeRays rays) {
  rtcInitIntersectContext(&context.embree);
  if (rays == EmbreeRays::kPackets) {
    context.embree.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  }
}

template <int Capacity>
void trace_single(RTCScene scene,
                  TraversalContext& context,
                  std::span<const Ray> rays,
                  EmbreeResult* results) {
  KBuffer<Capacity> buffer;
  context.buffers = &buffer;
  start(context, EmbreeRays::kSingle);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& r = rays[i];
    Blend blend;
    float t_near = r.t_min;
    buffer.start();
    for (;;) {
      RTCRayHit hit;
      hit.ray = {r.origin[0],
                 r.origin[1],
                 r.origin[2],
                 t_near,
                 r.direction[0],
                 r.direction[1],
                 r.direction[2],
                 0.0f,
                 r.t_max,
                 ~0u,
                 0,
                 0};
      hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      rtcIntersect1(scene, &context.embree, &hit);
      if (blend.add(buffer, context)) break;
      t_near = buffer.last_t();
      buffer.resume();
    }
    results[i] = blend.result();
  }
}

template <int Capacity>
void trace_packets(RTCScene scene,
                   TraversalContext& context,
                   std::span<const Ray> rays,
                   EmbreeResult* results) {
  std::vector<KBuffer<Capacity>> buffers(kLanes);
  context.buffers = buffers.data();
  start(context, EmbreeRays::kPackets);
  for (std::size_t first = 0; first < rays.size(); first += kLanes) {
    alignas(64) RTCRayHit16 packet;
    alignas(64) int valid[kLanes];
    Blend blends[kLanes];
    for (int i = 0; i < kLanes; ++i) {
      const Ray& r = rays[first + static_cast<std::size_t>(i)];
      packet.ray.org_x[i] = r.origin[0];
      packet.ray.org_y[i] = r.origin[1];
      packet.ray.org_z[i] = r.origin[2];
      packet.ray.dir_x[i] = r.direction[0];
      packet.ray.dir_y[i] = r.direction[1];
      packet.ray.dir_z[i] = r.direction[2];
      packet.ray.tnear[i] = r.t_min;
      packet.ray.time[i] = 0.0f;
      packet.ray.mask[i] = ~0u;
      packet.ray.id[i] = static_cast<unsigned>(i);
      packet.ray.flags[i] = 0;
      valid[i] = -1;
      buffers[static_cast<std::size_t>(i)].start();
    }
    for (bool alive = true; alive;) {
      for (int i = 0; i < kLanes; ++i) {
        packet.ray.tfar[i] = rays[first + static_cast<std::size_t>(i)].t_max;
        packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
        packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
      }
      rtcIntersect16(valid, scene, &context.embree, &packet);
      alive = false;
      for (int i = 0; i < kLanes; ++i) {
        if (valid[i] == 0) continue;
        KBuffer<Capacity>& buffer = buffers[static_cast<std::size_t>(i)];
        if (blends[i].add(buffer, context)) {
          valid[i] = 0;
          continue;
        }
        alive = true;
        packet.ray.tnear[i] = buffer.last_t();
        buffer.resume();
      }
    }
    for (int i = 0; i < kLanes; ++i)
      results[first + static_cast<std::size_t>(i)] = blends[i].result();
  }
}

/// The tracing function and the callback that belong to the options.
struct Variant {
  void (*trace)(RTCScene, TraversalContext&, std::span<const Ray>, EmbreeResult*);
  void (*intersect)(const TraversalContext&, const RTCIntersectFunctionNArguments*);
};

template <int Capacity>
Variant variant_of(EmbreeRays rays) {
  return rays == EmbreeRays::kSingle ? Variant{trace_single<Capacity>, intersect_single<Capacity>}
                                     : Variant{trace_packets<Capacity>, intersect_packet<Capacity>};
}

Variant variant_of(const EmbreeTraceOptions& options) {
  switch (options.capacity) {
    case 16:
      return variant_of<16>(options.rays);
    case 64:
      return variant_of<64>(options.rays);
    default:
      throw UsageError(fmt::format("The Embree tracer has no buffer of {} hits, choose 16 or 64.",
                                   options.capacity));
  }
}

void box_of(const RTCBoundsFunctionArguments* args) {
  const EmbreeBox& box = static_cast<const EmbreeBox*>(args->geometryUserPtr)[args->primID];
  *args->bounds_o = {box.lo[0], box.lo[1], box.lo[2], 0.0f, box.hi[0], box.hi[1], box.hi[2], 0.0f};
}

void dispatch(const RTCIntersectFunctionNArguments* args) {
  const auto& context = *reinterpret_cast<const TraversalContext*>(args->context);
  context.intersect(context, args);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

EmbreeTracer::EmbreeTracer(const Gaussians& model,
                           float quantile,
                           float min_transmittance,
                           int threads)
    : min_transmittance_(min_transmittance),
      threads_(threads),
      gaussians_(model.size()),
      boxes_(model.size()),
      quantile_(quantile) {
  constexpr double kDcBasis = 0.28209479177387814;
  const std::size_t stride = 3 * static_cast<std::size_t>(sh_coefficients(model.sh_degree));
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float* q = model.quaternions.data() + 4 * i;
    const glm::dmat3 rotation = glm::mat3_cast(glm::normalize(glm::dquat(q[0], q[1], q[2], q[3])));
    EmbreeGaussian& g = gaussians_[i];
    for (int axis = 0; axis < 3; ++axis) {
      double variance = 0.0;
      for (int k = 0; k < 3; ++k) {
        const double sigma =
            std::exp(double(model.log_scales[3 * i + static_cast<std::size_t>(k)]));
        // glm indexes columns first: rotation[k][axis] is row `axis` of column k.
        g.rows[3 * k + axis] = static_cast<float>(rotation[k][axis] / sigma);
        variance += rotation[k][axis] * rotation[k][axis] * sigma * sigma;
      }
      const float mean = model.means[3 * i + static_cast<std::size_t>(axis)];
      const float half = static_cast<float>(std::sqrt(quantile * variance) * 1.00001);
      g.mean[axis] = mean;
      g.rgb[axis] = static_cast<float>(
          std::max(0.0, 0.5 + kDcBasis * model.sh[stride * i + static_cast<std::size_t>(axis)]));
      boxes_[i].lo[axis] = std::nextafter(mean - half, -kInfinity);
      boxes_[i].hi[axis] = std::nextafter(mean + half, kInfinity);
    }
    g.opacity = static_cast<float>(1.0 / (1.0 + std::exp(-double(model.opacities[i]))));
  }
  device_.reset(rtcNewDevice(fmt::format("threads={}", threads).c_str()));
  if (!device_) {
    throw DeviceError("Embree could not open a device, check that the processor is supported.");
  }
}

void EmbreeTracer::check(const char* action) const {
  const RTCError error = rtcGetDeviceError(device_.get());
  if (error != RTC_ERROR_NONE) {
    throw DeviceError(
        fmt::format("Embree failed to {} {} boxes with error {}, try fewer Gaussians.", action,
                    boxes_.size(), static_cast<int>(error)));
  }
}

EmbreeTracer::Scene EmbreeTracer::make_scene(RTCBuildQuality quality, RTCSceneFlags flags) {
  Scene scene(rtcNewScene(device_.get()));
  rtcSetSceneBuildQuality(scene.get(), quality);
  rtcSetSceneFlags(scene.get(), flags);
  RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryBuildQuality(geometry, quality);
  rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(boxes_.size()));
  rtcSetGeometryUserData(geometry, boxes_.data());
  rtcSetGeometryBoundsFunction(geometry, box_of, nullptr);
  rtcSetGeometryIntersectFunction(geometry, dispatch);
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene.get(), geometry, 0);
  rtcReleaseGeometry(geometry);
  return scene;
}

double EmbreeTracer::build(RTCBuildQuality quality) {
  scene_ = make_scene(quality, RTC_SCENE_FLAG_NONE);
  const auto start = std::chrono::steady_clock::now();
  rtcCommitScene(scene_.get());
  const double seconds = seconds_since(start);
  check("build a tree over");
  return seconds;
}

double EmbreeTracer::refit() {
  const Scene scene = make_scene(RTC_BUILD_QUALITY_MEDIUM, RTC_SCENE_FLAG_DYNAMIC);
  rtcCommitScene(scene.get());
  RTCGeometry geometry = rtcGetGeometry(scene.get(), 0);
  rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_REFIT);
  rtcCommitGeometry(geometry);
  rtcCommitScene(scene.get());  // the first update sets the refitter up
  rtcCommitGeometry(geometry);
  const auto start = std::chrono::steady_clock::now();
  rtcCommitScene(scene.get());
  const double seconds = seconds_since(start);
  check("refit");
  return seconds;
}

std::vector<EmbreeResult> EmbreeTracer::trace(std::span<const Ray> rays,
                                              const EmbreeTraceOptions& options) const {
  if (rays.size() % kLanes != 0) {
    throw UsageError(fmt::format("The Embree tracer takes whole packets of {} rays, not {} rays.",
                                 kLanes, rays.size()));
  }
  constexpr std::size_t kChunk = 256;
  const Variant variant = variant_of(options);
  std::vector<EmbreeResult> results(rays.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    TraversalContext context{};
    context.intersect = variant.intersect;
    context.gaussians = gaussians_.data();
    context.quantile = quantile_;
    context.min_transmittance = min_transmittance_;
    for (std::size_t first; (first = next.fetch_add(kChunk)) < rays.size();) {
      const std::size_t count = std::min(kChunk, rays.size() - first);
      variant.trace(scene_.get(), context, rays.subspan(first, count), results.data() + first);
    }
  };
  std::vector<std::jthread> workers;
  for (int i = 1; i < threads_; ++i) workers.emplace_back(work);
  work();
  workers.clear();
  return results;
}

}  // namespace raysplats::peer
