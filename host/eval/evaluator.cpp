// SPDX-License-Identifier: Apache-2.0
#include "raysplats/evaluation.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "comm/communicator.hpp"
#include "eval/error_map.hpp"
#include "eval/metrics.hpp"
#include "eval/view_alignment.hpp"
#include "io/json_file.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "render/frame_writer.hpp"
#include "scene/sharpness.hpp"
#include "util/atomic_file.hpp"

namespace raysplats {
namespace {

struct Comparison {
  Image render;  // RGB in [0, 1]
  Image photo;   // RGB
  Image mask;    // one channel: how much each pixel counts
  double valid;  // share of the pixels that count
};

// RGB in [0, 1], in the memory of what was traced.
Image displayed(Image traced) {
  const auto channels = static_cast<std::size_t>(traced.channels);
  for (std::size_t p = 0; p < traced.pixels(); ++p) {
    for (std::size_t c = 0; c < 3; ++c)
      traced.data[3 * p + c] = std::clamp(traced.data[channels * p + c], 0.0f, 1.0f);
  }
  traced.channels = 3;
  traced.data.resize(3 * traced.pixels());
  return traced;
}

Image rgb_of(const Image& rgba) {
  Image out(rgba.width, rgba.height, 3);
  for (std::size_t p = 0; p < rgba.pixels(); ++p)
    std::copy_n(rgba.data.data() + 4 * p, 3, out.data.data() + 3 * p);
  return out;
}

Comparison compare(Image traced,
                   const ViewPicture& picture,
                   bool alpha_is_background,
                   const std::array<float, 3>& background) {
  const Image& rgba = picture.rgba;
  Comparison out{displayed(std::move(traced)),
                 alpha_is_background ? composite(rgba, background.data()) : rgb_of(rgba),
                 Image(rgba.width, rgba.height, 1, 1.0f), 1.0};
  const bool weighted = !picture.weight.data.empty();
  if (!weighted && alpha_is_background) return out;
  double weights = 0;
  for (std::size_t p = 0; p < rgba.pixels(); ++p) {
    out.mask.data[p] = weighted ? picture.weight.data[p] : rgba.data[4 * p + 3];
    weights += static_cast<double>(out.mask.data[p]);
  }
  out.valid = weights / static_cast<double>(rgba.pixels());
  return out;
}

// Makes the render equal to the photo where that is masked out.
void hide_masked_out(Comparison& pair) {
  if (pair.valid == 1.0) return;
  for (std::size_t i = 0; i < pair.render.data.size(); ++i) {
    const float photo = pair.photo.data[i];
    pair.render.data[i] = photo + pair.mask.data[i / 3] * (pair.render.data[i] - photo);
  }
}

// What ranks tell each other of a view.
struct MeasuredView {
  std::size_t index;  // among those that are evaluated
  bool compared, has_all, has_lpips, has_aligned;
  double psnr, psnr_corrected, psnr_all, ssim, lpips, sharpness, psnr_aligned;
};

double psnr_of(const Comparison& pair) {
  return std::min(weighted_psnr(pair.render, pair.photo, pair.mask), kMostPsnr);
}

// Leaves the pair as hide_masked_out() does.
MeasuredView measure(std::size_t index, Comparison& pair, Lpips* lpips) {
  MeasuredView out{};
  out.index = index;
  out.compared = pair.valid > 0;
  if (!out.compared) return out;
  out.psnr = psnr_of(pair);
  out.psnr_corrected = std::min(corrected_psnr(pair.render, pair.photo, pair.mask), kMostPsnr);
  out.has_all = pair.valid < 1.0;
  if (out.has_all) out.psnr_all = std::min(psnr(pair.render, pair.photo), kMostPsnr);
  hide_masked_out(pair);
  out.ssim = weighted_ssim(pair.render, pair.photo, pair.mask);
  out.has_lpips = lpips != nullptr;
  if (out.has_lpips) out.lpips = lpips->distance(pair.render, pair.photo);
  out.sharpness = sharpness(pair.photo);
  return out;
}

EvaluationMetrics metrics_of(const MeasuredView& view) {
  EvaluationMetrics out;
  out.psnr = view.psnr;
  out.ssim = view.ssim;
  out.psnr_corrected = view.psnr_corrected;
  if (view.has_all) out.psnr_all = view.psnr_all;
  if (view.has_aligned) out.psnr_aligned = view.psnr_aligned;
  if (view.has_lpips) out.lpips = view.lpips;
  out.sharpness = view.sharpness;
  return out;
}

// In the order of the views.
std::vector<MeasuredView> of_all_ranks(Communicator& ranks, const std::vector<MeasuredView>& own) {
  const std::string mine(reinterpret_cast<const char*>(own.data()),
                         own.size() * sizeof(MeasuredView));
  std::vector<MeasuredView> all;
  for (const std::string& theirs : ranks.gather(mine)) {
    const std::size_t before = all.size();
    all.resize(before + theirs.size() / sizeof(MeasuredView));
    std::copy(theirs.begin(), theirs.end(), reinterpret_cast<char*>(all.data() + before));
  }
  std::ranges::sort(all, {}, &MeasuredView::index);
  return all;
}

// Indices of the views whose pictures tell most: worst, middle and best by PSNR, then as they come;
// `most` at most.
std::set<std::size_t> telling(const std::vector<MeasuredView>& all, std::size_t most) {
  std::vector<MeasuredView> sorted;
  std::ranges::copy_if(all, std::back_inserter(sorted), &MeasuredView::compared);
  std::vector<std::size_t> wanted(sorted.size());
  std::ranges::transform(sorted, wanted.begin(), &MeasuredView::index);
  std::ranges::stable_sort(sorted, {}, &MeasuredView::psnr);
  if (!sorted.empty()) {
    wanted.insert(wanted.begin(),
                  {sorted.front().index, sorted[sorted.size() / 2].index, sorted.back().index});
  }
  std::set<std::size_t> out;
  for (const std::size_t index : wanted) {
    if (out.size() < most) out.insert(index);
  }
  return out;
}

nlohmann::json to_json(const EvaluationMetrics& metrics) {
  nlohmann::json json;
  if (!metrics.name.empty()) {
    json["name"] = metrics.name;
    json["center"] = metrics.center;
    json["sharpness"] = metrics.sharpness;
  }
  json["psnr"] = metrics.psnr;
  json["ssim"] = metrics.ssim;
  json["psnr_corrected"] = metrics.psnr_corrected;
  if (metrics.psnr_aligned) json["psnr_aligned"] = *metrics.psnr_aligned;
  if (metrics.psnr_all) json["psnr_all"] = *metrics.psnr_all;
  if (metrics.lpips) json["lpips"] = *metrics.lpips;
  if (!metrics.picture.empty()) json["picture"] = metrics.picture;
  return json;
}

EvaluationMetrics mean_of(const std::vector<EvaluationMetrics>& images) {
  EvaluationMetrics mean;
  const double share = 1.0 / static_cast<double>(images.size());
  // Of all views, those included whose pixels all count.
  const bool masked = std::any_of(images.begin(), images.end(), [](const EvaluationMetrics& image) {
    return image.psnr_all.has_value();
  });
  if (masked) mean.psnr_all = 0.0;
  for (const EvaluationMetrics& image : images) {
    mean.psnr += image.psnr * share;
    mean.ssim += image.ssim * share;
    mean.psnr_corrected += image.psnr_corrected * share;
    if (masked) *mean.psnr_all += image.psnr_all.value_or(image.psnr) * share;
    if (image.psnr_aligned)
      mean.psnr_aligned = mean.psnr_aligned.value_or(0.0) + *image.psnr_aligned * share;
    if (image.lpips) mean.lpips = mean.lpips.value_or(0.0) + *image.lpips * share;
  }
  return mean;
}

// `count` of the indices, evenly spread.
std::vector<std::size_t> spread(const std::vector<std::size_t>& indices, std::size_t count) {
  if (count == 0 || count >= indices.size()) return indices;
  std::vector<std::size_t> out(count);
  for (std::size_t i = 0; i < count; ++i) out[i] = indices[i * indices.size() / count];
  return out;
}

std::vector<std::string> names_of(const Dataset& dataset, const std::vector<std::size_t>& views) {
  std::vector<Camera> cameras;
  cameras.reserve(views.size());
  for (const std::size_t view : views) cameras.push_back(dataset.views[view].camera);
  return frame_names(cameras);
}

}  // namespace

std::vector<std::string> evaluated_names(const Dataset& dataset, Split split) {
  return names_of(dataset, dataset.indices(split));
}

std::string EvaluationReport::table() const {
  std::size_t width = 5;
  for (const EvaluationMetrics& image : images) width = std::max(width, image.name.size());
  std::string out =
      fmt::format("{:<{}} {:>8} {:>8} {:>9}{}{}\n", "image", width, "PSNR", "SSIM", "corrected",
                  mean.psnr_aligned ? "  aligned" : "", mean.lpips ? "    LPIPS" : "");
  const auto line = [&](const std::string& name, const EvaluationMetrics& m) {
    out += fmt::format("{:<{}} {:>8.3f} {:>8.4f} {:>9.3f}{}{}\n", name, width, m.psnr, m.ssim,
                       m.psnr_corrected,
                       m.psnr_aligned ? fmt::format(" {:>8.3f}", *m.psnr_aligned) : "",
                       m.lpips ? fmt::format(" {:>8.4f}", *m.lpips) : "");
  };
  for (const EvaluationMetrics& image : images) line(image.name, image);
  line("mean", mean);
  return out;
}

std::string EvaluationReport::json() const {
  nlohmann::json json = to_json(mean);
  json["images"] = nlohmann::json::array();
  for (const EvaluationMetrics& image : images) json["images"].push_back(to_json(image));
  return io::json_text(json, 2) + "\n";
}

EvaluationReport evaluate(const std::function<Image(const Camera&)>& render,
                          const Dataset& dataset,
                          Split split,
                          const std::array<float, 3>& background,
                          const std::filesystem::path& output,
                          const EvaluationOptions& options) {
  const std::vector<std::size_t> views = spread(dataset.indices(split), options.max_views);
  if (views.empty()) {
    throw UsageError(fmt::format(
        "The data set {} has no views to evaluate; choose another split or --test-every",
        dataset.root.string()));
  }
  const std::vector<std::string> names = names_of(dataset, views);
  if (!output.empty()) {
    std::error_code error;
    std::filesystem::create_directories(output, error);
    if (error)
      throw DataError(
          fmt::format("The folder {} cannot be created: {}", output.string(), error.message()));
  }

  Communicator alone;
  Communicator& ranks = options.ranks != nullptr ? *options.ranks : alone;
  if (options.align && options.together)
    throw UsageError("Views that ranks render together cannot be aligned with their photos");
  const bool compares = !options.together || ranks.leads();
  // None where it was stopped, and of pictures that another rank compares.
  const auto compare_view = [&](std::size_t i) -> std::optional<Comparison> {
    if (!compares) {
      render(dataset.views[views[i]].camera);
      return std::nullopt;
    }
    Image traced = render(dataset.views[views[i]].camera);
    if (traced.data.empty()) return std::nullopt;
    const ViewPicture picture = load_view_picture(dataset.views[views[i]]);
    const Image& rgba = picture.rgba;
    if (traced.width != rgba.width || traced.height != rgba.height || traced.channels < 3) {
      throw UsageError(fmt::format(
          "The render of {} is {}x{}x{}, its photo {}x{}; render at the camera's size", names[i],
          traced.width, traced.height, traced.channels, rgba.width, rgba.height));
    }
    return compare(std::move(traced), picture, dataset.alpha_is_background, background);
  };
  // After compare_view(), whose pair that is; none where it was stopped.
  const auto aligned_psnr = [&](std::size_t i, const Comparison& pair) -> std::optional<double> {
    const View& view = dataset.views[views[i]];
    const ViewPicture picture = load_view_picture(view);
    const auto compared = [&](Image traced) {
      return compare(std::move(traced), picture, dataset.alpha_is_background, background);
    };
    const auto shown = [&](const Camera& camera) {
      Image traced = render(camera);
      if (!options.align_colors || traced.data.empty()) return traced;
      return color_corrected(compared(std::move(traced)).render, pair.photo, pair.mask);
    };
    std::optional<AlignedView> aligned = align_view(shown, view.camera, pair.photo, pair.mask);
    if (!aligned) return std::nullopt;
    return psnr_of(compared(std::move(aligned->render)));
  };
  // Ranks that render together stop together.
  const auto for_all = [&](bool stop) { return options.together ? ranks.any(stop) : stop; };
  const auto picture_of = [&](std::size_t i) { return names[i] + ".png"; };
  const auto write_picture = [&](std::size_t i, const Comparison& pair) {
    write_image(output / picture_of(i), side_by_side(pair.photo, pair.render));
  };

  const std::size_t pictures = output.empty() ? 0 : options.max_pictures.value_or(views.size());
  const bool all_shown = pictures >= views.size();
  std::vector<MeasuredView> measured;
  bool stopped = false;
  const std::size_t rank = options.together ? 0 : static_cast<std::size_t>(ranks.rank());
  const std::size_t step = options.together ? 1 : static_cast<std::size_t>(ranks.size());
  for (std::size_t i = rank; i < views.size() && !stopped; i += step) {
    std::optional<Comparison> pair = compare_view(i);
    stopped = compares && !pair;
    if (pair) {
      measured.push_back(measure(i, *pair, options.lpips));
      if (all_shown && pair->valid > 0) write_picture(i, *pair);
      if (options.align && pair->valid > 0) {
        const std::optional<double> aligned = aligned_psnr(i, *pair);
        measured.back().has_aligned = true;
        measured.back().psnr_aligned = aligned.value_or(0.0);
        stopped = !aligned;
        if (stopped) measured.pop_back();
      }
      stopped = stopped || (options.done && !options.done(measured.size()));
    }
    stopped = for_all(stopped);
  }
  stopped = ranks.any(stopped);

  const std::vector<MeasuredView> all = of_all_ranks(ranks, measured);
  const std::set<std::size_t> shown = telling(all, pictures);
  // Which views tell most is known only now; tracing them again takes less than keeping all.
  bool cut_off = false;
  for (const std::size_t i : shown) {
    if (all_shown || i % step != rank) continue;
    std::optional<Comparison> pair = compare_view(i);
    cut_off = for_all(compares && !pair);
    if (cut_off) break;
    if (!pair) continue;
    hide_masked_out(*pair);
    write_picture(i, *pair);
  }
  // Those of other ranks are not known to be there.
  const bool named = !ranks.any(cut_off);

  EvaluationReport report;
  std::size_t empty = 0;
  std::string first_empty;
  for (const MeasuredView& view : all) {
    EvaluationMetrics metrics = metrics_of(view);
    const Camera& camera = dataset.views[views[view.index]].camera;
    metrics.name = camera.name.empty() ? names[view.index] : camera.name;
    const glm::dvec3 center = camera.center();
    metrics.center = {center.x, center.y, center.z};
    if (named && shown.contains(view.index)) metrics.picture = picture_of(view.index);
    if (view.compared) {
      report.images.push_back(metrics);
    } else if (empty++ == 0) {
      first_empty = metrics.name;
    }
  }
  if (report.images.empty() && stopped) return report;
  if (report.images.empty()) {
    throw DataError(
        fmt::format("No view of {} has a pixel to compare: their masks or lenses leave none",
                    dataset.root.string()));
  }
  if (empty > 0 && ranks.leads()) {
    spdlog::warn(
        "{} of {} views cannot be compared, {} among them: their masks or lenses leave no pixel",
        empty, all.size(), first_empty);
  }
  report.mean = mean_of(report.images);
  if (!output.empty() && ranks.leads()) write_text_file(output / "metrics.json", report.json());
  return report;
}

}  // namespace raysplats
