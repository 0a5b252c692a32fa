// SPDX-License-Identifier: Apache-2.0
// Paths advance one surface at a time, all of a batch of pixels together. A wave is
//   begin_paths        once: a path for every camera ray
//   (nearest_surface)  the next triangle of each ray
//   load_surfaces      its position, normals, colour; the ray ends there
//   (trace_rays)       the Gaussians in front of it; rays_to_surfaces and results_of_picture where
//                      packets have traced the camera's rays
//   shadow_rays, (light_through), (trace_rays), add_light
//                      per light and sample, for Gaussians and for surfaces
//   advance            what the path has gained, and the rays that go on: two slots a path
//   gather_paths       the rays that go on, without gaps
//   accumulate         what the paths of a pixel have gained
// Paths of a pixel are neighbours in every wave, so that one work-item can add them in their order:
// no atomics, the same picture every time. Launch: one work-item per path.
// Wavefront path tracing: Laine, Karras and Aila 2013.
#include "bvh/ray.h"
#include "light/shading.h"
#include "light/ways.h"

// direct: 1 when the rays leave the camera's centre.
__kernel void begin_paths(const uint count,
                          const int direct,
                          __global const RsRay* restrict rays,
                          __global const RsCone* restrict cones,
                          __global RsPath* restrict paths) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  RsPath path;
  path.skip = -1;
  path.pixel = i;
  path.begin = 0.0f;
  path.blind = rays[i].t_max < 0.0f;
  for (int k = 0; k < 3; ++k) path.throughput[k] = 1.0f;
  path.media[0] = path.media[1] = 0;
  path.splits = path.lineage = 0;
  path.direct = direct;
  path.width = cones[i].width;
  path.spread = cones[i].spread;
  paths[i] = path;
}

// The rays of a camera that end on a surface; those that meet none are empty (t_max < t_min).
__kernel void rays_to_surfaces(const uint count,
                               __global const RsSurface* restrict surfaces,
                               __global const RsRay* restrict rays,
                               __global RsRay* restrict ending) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  Ray ray = load_ray(rays, i);
  if (surfaces[i].material < 0) ray.t_max = -1.0f;
  store_ray(ray, ending, i);
}

// What the others meet, from a picture of the Gaussians alone: planar colour and alpha of `pixels`
// pixels. Its depths are asked for by lights on Gaussians (depths_of_picture), and in glass, in
// which no camera stands.
__kernel void results_of_picture(const uint count,
                                 const uint first_pixel,
                                 const uint pixels,
                                 __global const float* restrict picture,
                                 __global const RsSurface* restrict surfaces,
                                 __global RsRayResult* restrict results) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  if (surfaces[i].material >= 0) {
    results[i].capped = 0;  // the packets that made the picture have counted its ray
    return;
  }
  __global const float* at = picture + first_pixel + i;
  const size_t plane = pixels;
  const float3 color = (float3)(at[0], at[plane], at[2 * plane]);
  const RayResult result = {color, at[3 * plane], 0.0f, 0.0f, 0, 0};
  store_result(result, results, i);
}

// Their depths along the rays, from planes that count them along `axis` (depth_cosine).
__kernel void depths_of_picture(const uint count,
                                const uint first_pixel,
                                const uint pixels,
                                const float4 axis,
                                __global const float* restrict depth,
                                __global const RsSurface* restrict surfaces,
                                __global const RsRay* restrict rays,
                                __global RsRayResult* restrict results) {
  const uint i = get_global_id(0);
  if (i >= count || surfaces[i].material >= 0) return;
  const float cosine = depth_cosine(axis, load_ray(rays, i).direction);
  __global const float* at = depth + first_pixel + i;
  RayResult result = load_result(results, i);
  result.expected_depth = at[0] / cosine;
  result.median_depth = at[pixels] / cosine;
  store_result(result, results, i);
}

// vertices: as for surface_point(). materials_of: one per triangle.
__kernel void load_surfaces(const uint count,
                            __global const RsSurfaceHit* restrict hits,
                            __global const float* restrict vertices,
                            __global const uint* restrict materials_of,
                            __global const RsMaterial* restrict materials,
                            __global const RsTexture* restrict textures,
                            __global const float* restrict texels,
                            __global const RsPath* restrict paths,
                            __global RsRay* restrict rays,
                            __global uint* restrict from_origin,
                            __global RsCone* restrict cones,
                            __global RsSurface* restrict surfaces) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const RsSurfaceHit hit = hits[i];
  Ray ray = load_ray(rays, i);
  ray.t_min = paths[i].begin;
  ray.t_max = paths[i].blind ? -1.0f : (hit.triangle < 0 ? FLT_MAX : hit.t);
  store_ray(ray, rays, i);
  from_origin[i] = (uint)paths[i].direct;
  cones[i] = cone_of_path(paths + i);
  RsSurface s;
  s.t = hit.t;
  s.triangle = hit.triangle;
  s.material = -1;
  s.entering = 0;
  s.offset = 0.0f;
  for (int k = 0; k < 3; ++k) {
    s.position[k] = s.shading[k] = s.normal[k] = s.color[k] = s.shadow_origin[k] = 0.0f;
  }
  if (hit.triangle >= 0 && !paths[i].blind) {
    const SurfacePoint point = surface_point(vertices, &hit, ray.direction);
    s.entering = point.entering;
    s.offset = point.offset;
    s.material = (int)materials_of[hit.triangle];
    float3 color = vload3(0, materials[s.material].color);
    const int texture = materials[s.material].texture;
    if (texture >= 0) {
      const RsTexture t = textures[texture];
      const float2 uv = surface_uv(vertices, &hit);
      const float2 at = uv - floor(uv);
      color *= bilinear(texels + 3 * (size_t)t.offset, t.width, t.height, at.x * t.width,
                        at.y * t.height, true);
    }
    vstore3(point.position, 0, s.position);
    vstore3(point.shading, 0, s.shading);
    vstore3(point.normal, 0, s.normal);
    vstore3(color, 0, s.color);
    vstore3(shadow_origin(vertices, &hit, &point), 0, s.shadow_origin);
  }
  surfaces[i] = s;
}

// What one light sends to a point: direction and distance to its centre, and its strength there.
float3 light_at(__global const RsLight* light, float3 p, float3* direction, float* distance) {
  const float3 color = vload3(0, light->color);
  if (light->kind == RS_LIGHT_DIRECTIONAL) {
    *direction = -vload3(0, light->direction);
    *distance = FLT_MAX;
    return color;
  }
  const float3 v = vload3(0, light->position) - p;
  const float length2 = fmax(dot(v, v), 1e-20f);
  *distance = sqrt(length2);
  *direction = v / *distance;
  return color / length2;
}

// Depth at which a ray's Gaussians stand for shadows and absorption.
float gaussian_depth(const RayResult result, const Ray ray) {
  const float depth = result.alpha > 0.5f ? result.median_depth : result.expected_depth;
  return clamp(depth, ray.t_min, ray.t_max);
}

// The place there.
float3 gaussian_place(const RayResult result, const Ray ray) {
  return ray.origin + gaussian_depth(result, ray) * ray.direction;
}

// How far a Gaussian reaches from its centre towards a unit direction.
float reach_of_gaussian(__global const float* restrict quaternions,
                        __global const float* restrict log_scales,
                        const float quantile,
                        const uint i,
                        const float3 direction) {
  const float4 q = normalize(vload4(i, quaternions));
  const float3 axis = q.yzw;
  // The direction in the Gaussian's axes: turned by the conjugate.
  const float3 turned = direction + 2.0f * cross(axis, cross(axis, direction) - q.x * direction);
  return sqrt(quantile) * length(exp(vload3(i, log_scales)) * turned);
}

// What a light shines on: the rays that met Gaussians and surfaces, and what they met.
#define RS_LIT_ARGUMENTS                                                                  \
  __global const RsLight *restrict lights, __global const RsMaterial *restrict materials, \
      __global const RsRay *restrict rays, __global const RsRayResult *restrict results,  \
      __global const RsSurface *restrict surfaces

// Rays from what a path meets to sample `light_sample` of light `number`: from its surface
// (`target` 0), from its Gaussians to triangles (1) or to other Gaussians (2), which begin behind
// what the leading Gaussian reaches: its neighbours make the same surface. Where no light can come,
// and where no answer matters, the ray is empty (t_max < t_min).
__kernel void shadow_rays(const uint count,
                          const RsWave wave,
                          const int number,
                          const int light_sample,
                          const int target,
                          RS_LIT_ARGUMENTS,
                          __global const float* restrict quaternions,
                          __global const float* restrict log_scales,
                          const float quantile,
                          __global const RsPath* restrict paths,
                          __global RsRay* restrict out,
                          __global int* restrict skip) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const int gaussians = target > 0 ? 1 : 0;
  Ray ray = {(float3)(0.0f), (float3)(0.0f, 1.0f, 0.0f), 0.0f, -1.0f};
  int skipped = -1;
  float3 p = (float3)(0.0f), direction;
  float distance, begin = 0.0f;
  bool wanted = false;
  if (gaussians) {
    const RayResult result = load_result(results, i);
    if (result.alpha > 1e-3f) {
      p = gaussian_place(result, load_ray(rays, i));
      begin = wave.bias;
      wanted = max3(light_at(lights + number, p, &direction, &distance)) > 0.0f;
    }
  } else {
    const RsSurface s = surfaces[i];
    const int kind = s.material >= 0 ? materials[s.material].kind : RS_EMISSIVE;
    if (kind == RS_DIFFUSE || kind == RS_TRANSPARENT) {
      p = load3(s.position);
      const float3 e = light_at(lights + number, p, &direction, &distance);
      wanted = max3(e) > 0.0f && dot(load3(s.shading), direction) > 0.0f;
      // The side that n says is lit, though the light may be behind the triangle.
      p = load3(s.shadow_origin) + s.offset * load3(s.normal);
      skipped = s.triangle;
    }
  }
  if (wanted) {
    if (lights[number].kind == RS_LIGHT_DIRECTIONAL) {
      distance = FLT_MAX;
    } else {
      float3 to = vload3(0, lights[number].position);
      const float radius = lights[number].radius;
      if (lights[number].kind == RS_LIGHT_SPHERE && radius > 0.0f) {
        const uint block = 2 + 2 * wave.light_samples * number + 2 * light_sample + gaussians;
        const uint lane = (uint)(wave.bounce * 4 + paths[i].lineage) << 16;
        const RsRandom4 r =
            rs_random4(wave.seed_lo, wave.seed_hi, wave.first_pixel + paths[i].pixel, wave.sample,
                       lane + block);
        float3 a, b;
        frame_of(direction, &a, &b);
        const float reach = radius * sqrt(r.x);
        to += reach * cos(2.0f * RS_PI * r.y) * a + reach * sin(2.0f * RS_PI * r.y) * b;
      }
      const float3 v = to - p;
      distance = length(v);
      direction = v / fmax(distance, 1e-20f);
    }
    if (target == 2) {
      begin = fmax(
          begin, reach_of_gaussian(quaternions, log_scales, quantile, results[i].hits, direction));
    }
    ray.origin = p;
    ray.direction = direction;
    ray.t_min = begin;
    ray.t_max = distance;
  }
  store_ray(ray, out, i);
  skip[i] = skipped;
}

// Adds a light sample to gaussian_light (sum of weight V, sum of weights, number of rays, number
// that max_hits stopped) or to surface_light (diffuse rgb, number of rays, specular rgb, number
// that max_hits stopped). passes: light that passes the triangles; blocked: results of the
// Gaussians on the way; either counts only where its flag is set.
__kernel void add_light(const uint count,
                        const RsWave wave,
                        const int number,
                        const float share,
                        const int gaussians,
                        const int use_triangles,
                        const int use_gaussians,
                        RS_LIT_ARGUMENTS,
                        __global const RsRay* restrict shadow,
                        __global const float* restrict passes,
                        __global const RsRayResult* restrict blocked,
                        __global float4* restrict gaussian_light,
                        __global float8* restrict surface_light) {
  const uint i = get_global_id(0);
  if (i >= count || shadow[i].t_max < 0.0f) return;
  float visible = 1.0f;
  if (use_triangles) visible *= passes[i];
  if (use_gaussians) visible *= 1.0f - blocked[i].alpha;
  visible = 1.0f - wave.strength * (1.0f - visible);
  const float capped = use_gaussians && blocked[i].capped != 0 ? 1.0f : 0.0f;
  float3 direction;
  float distance;
  if (gaussians) {
    const float3 p = gaussian_place(load_result(results, i), load_ray(rays, i));
    const float weight = share * max3(light_at(lights + number, p, &direction, &distance));
    gaussian_light[i] += (float4)(weight * visible, weight, 1.0f, capped);
    return;
  }
  const RsSurface s = surfaces[i];
  const float3 e =
      visible * share * light_at(lights + number, load3(s.position), &direction, &distance);
  const float3 n = load3(s.shading);
  const float3 half_vector = normalize(direction - load_ray(rays, i).direction);
  const float lobe =
      pow(fmax(dot(n, half_vector), 0.0f), lobe_exponent(materials[s.material].roughness));
  const float3 diffuse = e * fmax(dot(n, direction), 0.0f);
  const float3 specular = e * (materials[s.material].specular * lobe);
  surface_light[i] += (float8)(diffuse, 1.0f, specular, capped);
}

// gained[i]: colour that path i has gained, and the share of its light that left the scene.
// tallies[i]: shadow rays, rays that max_hits stopped (the path's own with them), rays that
// max_bounces ended.
// counts[i]: rays that go on, in the slots 2 i and 2 i + 1.
__kernel void advance(const uint count,
                      const RsWave wave,
                      __global const RsMaterial* restrict materials,
                      __global const RsEnvironment* restrict environment,
                      __global const float* restrict picture,
                      __global const RsPath* restrict paths,
                      __global const RsRay* restrict rays,
                      __global const RsRayResult* restrict results,
                      __global const RsSurface* restrict surfaces,
                      __global const float4* restrict gaussian_light,
                      __global const float8* restrict surface_light,
                      __global float4* restrict gained,
                      __global uint* restrict counts,
                      __global RsPath* restrict next_paths,
                      __global RsRay* restrict next_rays,
                      __global uint4* restrict tallies) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  __global const RsPath* path = paths + i;
  __global const RsSurface* s = surfaces + i;
  counts[i] = 0;
  tallies[i] = (uint4)(0);
  if (path->blind) {
    gained[i] = (float4)(0.0f, 0.0f, 0.0f, 1.0f);
    return;
  }
  const Ray ray = load_ray(rays, i);
  const RayResult result = load_result(results, i);
  const float4 light = gaussian_light[i];
  uint4 tally = (uint4)((uint)light.z + (uint)surface_light[i].s3,
                        (uint)light.w + (uint)surface_light[i].s7 + result.capped, 0, 0);
  float3 throughput = vload3(0, path->throughput);
  float3 to_gaussians = throughput;
  const uint body = innermost(media_of(path));
  if (body != 0) {
    const float3 sigma = vload3(0, materials[body - 1].absorption);
    const float depth = gaussian_depth(result, ray);
    // Nothing is left after an infinite way, but clear glass stays clear.
    const float3 length = fmin((float3)(ray.t_max - ray.t_min), (float3)(1e30f));
    to_gaussians *= exp(-sigma * (depth - ray.t_min));
    throughput *= exp(-sigma * length);
  }
  const float shade = light.y > 0.0f ? light.x / light.y : 1.0f;
  float3 sum = to_gaussians * shade * result.color;
  throughput *= 1.0f - result.alpha;
  if (s->material < 0) {
    sum += throughput * environment_color(environment, picture, ray.direction);
    gained[i] = (float4)(sum, (throughput.x + throughput.y + throughput.z) / 3.0f);
    tallies[i] = tally;
    return;
  }
  __global const RsMaterial* material = materials + s->material;
  const int kind = material->kind;
  const float3 color = vload3(0, s->color), n = vload3(0, s->shading);
  sum += throughput * vload3(0, material->emission);
  const float weight = kind == RS_TRANSPARENT ? material->opacity : 1.0f;
  if (kind == RS_DIFFUSE || kind == RS_TRANSPARENT) {
    const float8 direct = surface_light[i];
    float3 diffuse = direct.s012;
    if (!wave.indirect || kind == RS_TRANSPARENT) {
      diffuse += load3(wave.ambient) + environment_light(environment, n);
    }
    sum += throughput * weight * (color * diffuse + direct.s456);
  }
  gained[i] = (float4)(sum, 0.0f);
  Way first, second;
  const uint ways =
      ways_from(&wave, path, s, ray.direction, throughput, materials, &first, &second);
  const bool last = wave.bounce + 1 >= wave.max_bounces;
  uint kept = 0;
  for (uint k = 0; k < ways; ++k) {
    if (max3(first.throughput) >= wave.min_throughput) {
      if (last) {
        ++tally.z;
      } else {
        take_way(first, k, ways, path, s, ray, 2 * (size_t)i + kept, next_paths, next_rays);
        ++kept;
      }
    }
    if (k + 1 < ways) first = second;
  }
  counts[i] = kept;
  tallies[i] = tally;
}

// offsets: exclusive sums of the counts, and their total behind them.
__kernel void gather_paths(const uint count,
                           __global const uint* restrict offsets,
                           __global const RsPath* restrict next_paths,
                           __global const RsRay* restrict next_rays,
                           __global RsPath* restrict paths,
                           __global RsRay* restrict rays) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const uint first = offsets[i], last = offsets[i + 1];
  for (uint k = first; k < last; ++k) {
    paths[k] = next_paths[2 * (size_t)i + (k - first)];
    store_ray(load_ray(next_rays, 2 * (size_t)i + (k - first)), rays, k);
  }
}

// The first path of every pixel adds what all paths of the pixel gained to sums (rgb, share that
// left the scene), of which the batch's begin at `first`.
__kernel void accumulate(const uint count,
                         const uint first,
                         __global const RsPath* restrict paths,
                         __global const float4* restrict gained,
                         __global float4* restrict sums) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const uint pixel = paths[i].pixel;
  if (i > 0 && paths[i - 1].pixel == pixel) return;
  float4 sum = sums[first + pixel];
  for (uint k = i; k < count && paths[k].pixel == pixel; ++k) sum += gained[k];
  sums[first + pixel] = sum;
}

// partials[g] = sum of chunk g of the tallies. Launch: one work-item per chunk.
__kernel void sum_tallies(const uint count,
                          const uint chunk,
                          __global const uint4* restrict tallies,
                          __global uint4* restrict partials) {
  const uint begin = min((uint)get_global_id(0) * chunk, count);
  const uint end = min(begin + chunk, count);
  uint4 sum = (uint4)(0);
  for (uint i = begin; i < end; ++i) sum += tallies[i];
  partials[get_global_id(0)] = sum;
}
