// SPDX-License-Identifier: Apache-2.0
#include "render/frame_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <set>
#include <span>
#include <utility>

#include "comm/communicator.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "render/bands.hpp"
#include "render/previews.hpp"
#include "render/shutter.hpp"
#include "util/clock.hpp"
#include "util/srgb.hpp"

namespace raysplats {
namespace {

constexpr int kMaxSupersample = 16;

/// The folders and the stem of an image name in one word; "." and ".." of relative names vanish.
std::string joined(const std::filesystem::path& name) {
  std::string out;
  for (const std::filesystem::path& part : name.parent_path().relative_path()) {
    if (part != "." && part != ".." && !part.empty()) out += part.string() + "_";
  }
  return out + name.stem().string();
}

Image with_channels(const Image& image, int channels) {
  Image out(image.width, image.height, channels);
  const auto from = static_cast<std::size_t>(image.channels);
  const auto to = static_cast<std::size_t>(channels);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    for (std::size_t c = 0; c < std::min(from, to); ++c)
      out.data[i * to + c] = image.data[i * from + c];
  }
  return out;
}

/// Expected depth times alpha, and alpha: samples that met nothing carry no depth, so blocks and
/// moments average by alpha.
Image weighted_depth(const Image& depth, const Image& rgba) {
  Image weighted(depth.width, depth.height, 2);
  for (std::size_t i = 0; i < depth.pixels(); ++i) {
    const float alpha = rgba.data[4 * i + 3];
    const float z = depth.data[i * static_cast<std::size_t>(depth.channels)];
    weighted.data[2 * i] = alpha * z;
    weighted.data[2 * i + 1] = alpha;
  }
  return weighted;
}

/// Expected depth at the size of the frame, from weighted_depth().
Image average_depth(const Image& weighted, int factor) {
  const Image mean = box_average(weighted, factor);
  Image out(mean.width, mean.height, 1);
  for (std::size_t i = 0; i < mean.pixels(); ++i) {
    const float alpha = mean.data[2 * i + 1];
    out.data[i] = alpha > 0.0f ? mean.data[2 * i] / alpha : 0.0f;
  }
  return out;
}

/// A frame at its number of rays per pixel, means of the moments at which the shutter is open.
struct Exposed {
  Image rgba;   ///< empty when it was stopped
  Image depth;  ///< weighted_depth(), where options ask
  Image hits;   ///< where options ask
  std::uint64_t reflected_rays = 0;
  std::uint64_t capped_rays = 0;
};

Exposed exposed(Tracer& tracer,
                const Model& model,
                std::span<const Camera> cameras,
                std::size_t frame,
                const FrameOptions& options,
                Communicator& ranks,
                const std::function<bool(double)>& within) {
  const int moments = options.shutter_samples;
  Exposed out;
  for (int k = 0; k < moments; ++k) {
    const Camera camera = camera_between(cameras, frame, moment(options, k), options.closed);
    Image picture =
        tracer.render(model, downscaled(camera, 1.0 / options.supersample), false,
                      [&](double share) { return !within || within((k + share) / moments); });
    if (ranks.all_reduce_or(picture.data.empty())) return {};
    collect_rows(ranks, tracer.rows(), picture);
    if (options.depth || options.hits) {
      Image depth = tracer.depth();
      collect_rows(ranks, tracer.rows(), depth);
      if (options.depth) add(out.depth, weighted_depth(depth, picture));
      if (options.hits) add(out.hits, hits_of(depth));
    }
    add(out.rgba, std::move(picture));
    out.reflected_rays += tracer.reflected_rays();
    out.capped_rays += tracer.capped_rays();
  }
  for (Image* image : {&out.rgba, &out.depth, &out.hits}) divide(*image, moments);
  return out;
}

void write_files(const std::filesystem::path& stem,
                 const Image& rgba,
                 const Camera& camera,
                 const FrameLayers& layers,
                 const FrameOptions& options) {
  const auto file = [&](const char* suffix, const std::filesystem::path& type) {
    std::filesystem::path path = stem;
    path += suffix;
    path += type;
    return path;
  };
  if (options.format == FrameFormat::kExr) {
    std::vector<std::string> names;
    std::vector<const Image*> more;
    const auto add = [&](bool wanted, const Image& layer, const std::vector<std::string>& of) {
      if (!wanted) return;
      more.push_back(&layer);
      names.insert(names.end(), of.begin(), of.end());
    };
    add(options.depth, layers.depth, {"Z"});
    add(options.normals, layers.normals, {"N.X", "N.Y", "N.Z"});
    add(options.hits, layers.hits, {"hits"});
    const std::size_t count = 4 + names.size();
    Image channels = with_channels(rgba, static_cast<int>(count));
    for (std::size_t i = 0; i < channels.pixels(); ++i) {
      float* pixel = &channels.data[count * i];
      for (std::size_t c = 0; c < 3 && options.linear_exr; ++c)
        pixel[c] = light_from_display(pixel[c]);
      pixel += 4;
      for (const Image* layer : more) {
        const auto width = static_cast<std::size_t>(layer->channels);
        pixel = std::copy_n(&layer->data[width * i], width, pixel);
      }
    }
    write_image(file("", file_extension(options.format)), channels, names,
                options.linear_exr ? ColorSpace::kLinear : ColorSpace::kDisplay);
    return;
  }
  write_image(file("", file_extension(options.format)), with_channels(rgba, 3));
  const Image& alpha = layers.alpha.data.empty() ? rgba : layers.alpha;
  if (options.depth) write_image(file("_depth", ".png"), depth_preview(layers.depth, alpha));
  if (options.normals)
    write_image(file("_normals", ".png"), normals_preview(layers.normals, alpha, camera));
  if (options.hits) write_image(file("_hits", ".png"), hits_preview(layers.hits));
}

}  // namespace

std::string file_extension(FrameFormat format) {
  switch (format) {
    case FrameFormat::kExr:
      return ".exr";
    case FrameFormat::kJpg:
      return ".jpg";
    case FrameFormat::kPng:
      break;
  }
  return ".png";
}

std::vector<std::string> frame_names(std::span<const Camera> cameras) {
  std::vector<std::string> names(cameras.size());
  std::map<std::string, std::size_t> stems;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    names[i] = std::filesystem::path(cameras[i].name).stem().string();
    if (names[i].empty()) names[i] = fmt::format("frame_{:04d}", i);
    ++stems[names[i]];
  }
  std::set<std::string> used;
  // The first number behind a name that was not tried yet: many frames may have one name.
  std::map<std::string, int> untried;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    std::string name = names[i];
    if (stems[name] > 1) {
      name = joined(cameras[i].name);
      if (name.empty()) name = names[i];
    }
    std::string unique = name;
    int& n = untried.try_emplace(name, 2).first->second;
    for (; !used.insert(unique).second; ++n) unique = fmt::format("{}_{}", name, n);
    names[i] = unique;
  }
  return names;
}

void FrameWriter::add(const std::string& name,
                      Image rgba,
                      const Camera& camera,
                      FrameLayers layers) {
  if (options_.video) options_.video->add(rgba);
  if (!options_.files) return;
  const std::size_t bytes =
      sizeof(float) * (rgba.data.size() + layers.depth.data.size() + layers.normals.data.size() +
                       layers.hits.data.size() + layers.alpha.data.size());
  files_.add(bytes,
             [&options = options_, stem = folder_ / name, rgba = std::move(rgba), camera,
              layers = std::move(layers)] { write_files(stem, rgba, camera, layers, options); });
}

FrameReport write_frames(Tracer& tracer,
                         const Model& model,
                         std::span<const Camera> cameras,
                         const std::filesystem::path& folder,
                         const FrameOptions& options,
                         const std::function<bool(std::size_t)>& done,
                         const std::function<bool(double)>& within) {
  if (options.supersample < 1 || options.supersample > kMaxSupersample) {
    throw UsageError(fmt::format("--supersample {} is out of range: use 1 to {}",
                                 options.supersample, kMaxSupersample));
  }
  check_shutter(options);
  const std::vector<std::string> names = frame_names(cameras);
  FrameWriter writer(folder, options);
  FrameReport report;
  Communicator alone;
  Communicator& ranks = options.bands != nullptr ? *options.bands : alone;
  tracer.set_share(static_cast<std::size_t>(ranks.rank()), static_cast<std::size_t>(ranks.size()));
  for (std::size_t i = options.offset; i < cameras.size(); i += options.stride) {
    const double built = tracer.context().build_seconds();
    const auto start = std::chrono::steady_clock::now();
    const Exposed samples = exposed(tracer, model, cameras, i, options, ranks, within);
    if (samples.rgba.data.empty()) break;
    FrameLayers layers;
    if (options.depth) layers.depth = average_depth(samples.depth, options.supersample);
    if (options.hits) layers.hits = box_average(samples.hits, options.supersample);
    report.trace_seconds += seconds_since(start) - (tracer.context().build_seconds() - built);
    report.reflected_rays += samples.reflected_rays;
    report.capped_rays += samples.capped_rays;
    // What follows is left to the one that leads.
    if (!ranks.leads()) {
      if (ranks.all_reduce_or(done && !done(report.frames))) break;
      continue;
    }
    report.rays += samples.rgba.pixels() * static_cast<std::uint64_t>(options.shutter_samples);
    if (options.normals) {
      const double last = moment(options, options.shutter_samples - 1);
      const Image sums = tracer.normals(
          model,
          downscaled(camera_between(cameras, i, last, options.closed), 1.0 / options.supersample),
          within);
      if (sums.data.empty()) {
        ranks.all_reduce_or(true);
        break;
      }
      layers.normals = unit_normals(box_average(sums, options.supersample));
    }
    writer.add(names[i], box_average(samples.rgba, options.supersample), cameras[i],
               std::move(layers));
    ++report.frames;
    if (ranks.all_reduce_or(done && !done(report.frames))) break;
  }
  tracer.set_share(0, 1);
  writer.finish();
  return report;
}

}  // namespace raysplats
