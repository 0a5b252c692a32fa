// SPDX-License-Identifier: Apache-2.0
// The ways of a path from a surface: reflected, refracted, scattered or straight on.
#ifndef RS_LIGHT_WAYS_H
#define RS_LIGHT_WAYS_H

#include "bvh/ray.h"
#include "light/shading.h"

// A way that a path takes from a surface.
typedef struct {
  float3 throughput;
  float3 direction;  // unit; of no meaning straight on
  Media media;
  bool straight;  // in the same direction: the ray keeps its origin and looks behind the surface
} Way;

Way way_along(float3 direction, float3 throughput, Media media) {
  const Way way = {throughput, normalize(direction), media, false};
  return way;
}

Way way_straight_on(float3 throughput, Media media) {
  const Way way = {throughput, (float3)(0.0f), media, true};
  return way;
}

// The path that takes way `number` of `ways`, and its ray: into slot `at`.
void take_way(const Way way,
              uint number,
              uint ways,
              __global const RsPath* path,
              __global const RsSurface* s,
              Ray ray,
              size_t at,
              __global RsPath* next_paths,
              __global RsRay* next_rays) {
  RsPath next = *path;
  next.skip = s->triangle;
  next.lineage += number << next.splits;
  next.splits += ways - 1;
  vstore3(way.throughput, 0, next.throughput);
  store_media(way.media, &next);
  ray.t_max = FLT_MAX;
  if (way.straight) {
    next.begin = as_float(as_uint(s->t) + 1u);
    ray.t_min = s->t;
  } else {
    const float3 d = way.direction, normal = vload3(0, s->normal), from = vload3(0, s->position);
    const bool back = dot(d, normal) >= 0.0f;  // to where it came from
    next.begin = 0.0f;
    next.direct = 0;
    next.width = cone_behind(cone_of_path(path), s->t).width;
    ray.origin = back ? start_off_surface(from, normal, d, s->offset) : from - s->offset * normal;
    ray.direction = d;
    ray.t_min = 0.0f;
  }
  next_paths[at] = next;
  store_ray(ray, next_rays, at);
}

// Both ways of a ray along d from a glass surface, or the one that is left of them; returns how
// many.
uint pass_glass(__global const RsPath* path,
                float3 d,
                __global const RsSurface* s,
                float3 throughput,
                __global const RsMaterial* materials,
                float choice,
                Way* first,
                Way* second) {
  const uint body = (uint)s->material + 1;
  const float own = materials[s->material].ior;
  const Media before = media_of(path);
  const Media after = s->entering ? media_enter(before, body) : media_leave(before, body);
  float before_ior = innermost_ior(before, materials), after_ior = own;
  if (!s->entering) {
    if (after == before) before_ior = own;
    after_ior = innermost_ior(after, materials);
  }
  const float3 into = throughput * vload3(0, s->color);
  if (before_ior == after_ior) {
    *first = way_straight_on(into, after);
    return 1;
  }
  const float3 normal = vload3(0, s->normal);
  const float ratio = before_ior / after_ior;
  float3 n = vload3(0, s->shading);
  float cosine = -dot(d, n), cosine_out = 0.0f, F = 1.0f;
  float3 reflection = d, refraction = d;
  bool sound = false;
  for (int attempt = 0; attempt < 2 && !sound; ++attempt) {
    if (attempt == 1) {
      n = normal;
      cosine = -dot(d, n);
    }
    if (attempt == 0 && cosine <= 0.0f) continue;
    cosine = clamp(cosine, 0.0f, 1.0f);
    F = fresnel(cosine, ratio, &cosine_out);
    reflection = reflected(d, n);
    refraction = ratio * d + (ratio * cosine - cosine_out) * n;
    sound = dot(reflection, normal) > 0.0f && (F >= 1.0f || dot(refraction, normal) < 0.0f);
  }
  if (F < 1.0f && path->splits < 2) {
    *first = way_along(reflection, throughput * F, before);
    *second = way_along(refraction, into * (1.0f - F), after);
    return 2;
  }
  *first = F >= 1.0f || choice < F ? way_along(reflection, throughput, before)
                                   : way_along(refraction, into, after);
  return 1;
}

// The ways from a surface that is reached along d, by its material; returns how many, at most two.
uint ways_from(const RsWave* wave,
               __global const RsPath* path,
               __global const RsSurface* s,
               const float3 d,
               const float3 throughput,
               __global const RsMaterial* materials,
               Way* first,
               Way* second) {
  __global const RsMaterial* material = materials + s->material;
  const float3 color = vload3(0, s->color), n = vload3(0, s->shading);
  const float3 normal = vload3(0, s->normal);
  const uint block = (uint)(wave->bounce * 4 + path->lineage) << 16 | 1u;
  const RsRandom4 random = rs_random4(wave->seed_lo, wave->seed_hi, wave->first_pixel + path->pixel,
                                      wave->sample, block);
  switch (material->kind) {
    case RS_TRANSPARENT:
      *first = way_straight_on(throughput * (1.0f - material->opacity), media_of(path));
      return 1;
    case RS_DIFFUSE: {
      if (!wave->indirect) return 0;
      const float3 direction = cosine_direction(n, random.x, random.y);
      *first = way_along(direction, throughput * color, media_of(path));
      return dot(direction, normal) > 0.0f ? 1 : 0;
    }
    case RS_MIRROR: {
      float3 facet = n;
      if (material->roughness > 0.0f && wave->scatter)
        facet = ggx_normal(n, material->roughness, random.x, random.y);
      float3 direction = reflected(d, facet);
      if (dot(direction, normal) <= 0.0f) direction = reflected(d, normal);
      *first = way_along(direction, throughput * color, media_of(path));
      return 1;
    }
    case RS_GLASS:
      return pass_glass(path, d, s, throughput, materials, random.z, first, second);
    default:
      return 0;
  }
}

#endif
