// SPDX-License-Identifier: Apache-2.0
#include "raysplats/evaluation.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "comm/communicator.hpp"
#include "eval/error_map.hpp"
#include "eval/metrics.hpp"
#include "eval/shift_fit.hpp"
#include "eval/view_alignment.hpp"
#include "io/dataset/dataset_views.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "render/frame_writer.hpp"
#include "scene/even_choice.hpp"
#include "scene/image/image_check.hpp"
#include "scene/image/sharpness.hpp"
#include "trace/sky.hpp"
#include "util/atomic_file.hpp"
#include "util/background_tasks.hpp"

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

// Makes the render nearly equal to the photo where that hardly counts, as at the edges of masks,
// for windows that reach there and for LPIPS, which knows no mask. Pixels that count at least half
// as much as the most are shown as they are: how much they count is for the means over them to say.
void hide_masked_out(Comparison& pair) {
  if (pair.valid == 1.0) return;
  const float most = *std::max_element(pair.mask.data.begin(), pair.mask.data.end());
  if (!(most > 0.0f)) return;
  for (std::size_t i = 0; i < pair.render.data.size(); ++i) {
    const float share = std::min(1.0f, 2.0f * pair.mask.data[i / 3] / most);
    const float photo = pair.photo.data[i];
    if (share < 1.0f) pair.render.data[i] = photo + share * (pair.render.data[i] - photo);
  }
}

// What ranks tell each other of a view.
struct MeasuredView {
  std::size_t index;  // among those that are evaluated
  bool compared, has_all, has_lpips, has_aligned;
  double psnr, psnr_corrected, psnr_all, ssim, lpips, psnr_aligned;
  ShiftFit shifted;
  Sharpness sharpness;
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
  out.shifted = fit_shift(pair.render, pair.photo, pair.mask);
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
  out.psnr_shifted = std::min(view.psnr + view.shifted.gain, kMostPsnr);
  out.shift = {view.shifted.shift.x, view.shifted.shift.y};
  if (view.has_all) out.psnr_all = view.psnr_all;
  if (view.has_aligned) out.psnr_aligned = view.psnr_aligned;
  if (view.has_lpips) out.lpips = view.lpips;
  out.sharpness = view.sharpness.fine;
  out.coarse_sharpness = view.sharpness.coarse;
  return out;
}

// In the order of the views.
std::vector<MeasuredView> of_all_ranks(Communicator& ranks, const std::vector<MeasuredView>& own) {
  const std::string mine(reinterpret_cast<const char*>(own.data()),
                         own.size() * sizeof(MeasuredView));
  std::vector<MeasuredView> all;
  for (const std::string& theirs : ranks.all_gather_texts(mine)) {
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
    mean.psnr_shifted += image.psnr_shifted * share;
    if (masked) *mean.psnr_all += image.psnr_all.value_or(image.psnr) * share;
    if (image.psnr_aligned)
      mean.psnr_aligned = mean.psnr_aligned.value_or(0.0) + *image.psnr_aligned * share;
    if (image.lpips) mean.lpips = mean.lpips.value_or(0.0) + *image.lpips * share;
  }
  return mean;
}

// At most `count` of the indices, evenly spread; all of them for 0.
std::vector<std::size_t> spread(const std::vector<std::size_t>& indices, std::size_t count) {
  if (count == 0) return indices;
  std::vector<std::size_t> out = even_choice(indices.size(), count);
  for (std::size_t& i : out) i = indices[i];
  return out;
}

// Of a picture that a caller gives of a view.
void check_size(const Image& image, const Camera& camera, int channels, const std::string& what) {
  if (image.width != camera.width || image.height != camera.height || image.channels < channels) {
    throw UsageError(fmt::format(
        "{} is {}x{}x{}, its camera {}x{}: give the camera's size and at least {} channels", what,
        image.width, image.height, image.channels, camera.width, camera.height, channels));
  }
  check_image(image, what);
}

std::vector<std::string> names_of(const Dataset& dataset, const std::vector<std::size_t>& views) {
  return frame_names(cameras_of(dataset, views));
}

// One call of evaluate(): some views of a data set, by their numbers among those.
class Evaluation {
 public:
  Evaluation(const std::function<Image(const Camera&)>& render,
             const Dataset& dataset,
             const std::vector<std::size_t>& views,
             const std::array<float, 3>& background,
             const std::filesystem::path& output,
             const EvaluationOptions& options)
      : render_(render),
        dataset_(dataset),
        views_(views),
        names_(names_of(dataset, views)),
        background_(background),
        output_(output),
        options_(options),
        ranks_(options.ranks != nullptr ? *options.ranks : alone_),
        compares_(!options.together || ranks_.leads()),
        first_(options.together ? 0 : static_cast<std::size_t>(ranks_.rank())),
        step_(options.together ? 1 : static_cast<std::size_t>(ranks_.size())),
        pictures_(output.empty() ? 0 : options.max_pictures.value_or(views.size())),
        all_shown_(pictures_ >= views.size()) {}

  // This rank's share, and then what the others say of theirs.
  void measure_views() {
    std::vector<MeasuredView> own;
    for (std::size_t i = first_; i < views_.size() && !stopped_; i += step_)
      stopped_ = for_all(!measure_view(i, own));
    stopped_ = ranks_.all_reduce_or(stopped_);
    all_ = of_all_ranks(ranks_, own);
  }

  // Which views tell most is known only now; tracing them again takes less than keeping all.
  void write_telling_pictures() {
    shown_ = telling(all_, pictures_);
    bool cut_off = false;
    for (const std::size_t i : shown_) {
      if (all_shown_ || i % step_ != first_) continue;
      std::optional<Comparison> pair = compare_view(i);
      cut_off = for_all(compares_ && !pair);
      if (cut_off) break;
      if (!pair) continue;
      hide_masked_out(*pair);
      write_picture(i, *pair);
    }
    files_.finish();
    // Those of other ranks are not known to be there.
    if (ranks_.all_reduce_or(cut_off)) shown_.clear();
  }

  EvaluationReport report() const {
    EvaluationReport out;
    std::size_t empty = 0;
    std::string first_empty;
    for (const MeasuredView& measured : all_) {
      const Camera& camera = view(measured.index).camera;
      const glm::dvec3 center = camera.center();
      EvaluationMetrics metrics = metrics_of(measured);
      metrics.name = camera.name.empty() ? names_[measured.index] : camera.name;
      metrics.center = {center.x, center.y, center.z};
      if (shown_.contains(measured.index)) metrics.picture = picture_of(measured.index);
      if (measured.compared) {
        out.images.push_back(metrics);
      } else if (empty++ == 0) {
        first_empty = metrics.name;
      }
    }
    if (out.images.empty() && stopped_) return out;
    if (out.images.empty()) {
      throw DataError(fmt::format(
          "No view of {} has a pixel to compare: their masks, lenses or ignore-areas leave none",
          dataset_.root.string()));
    }
    if (empty > 0 && ranks_.leads()) {
      spdlog::warn(
          "{} of {} views cannot be compared, {} among them: their masks, lenses or ignore-areas "
          "leave no pixel",
          empty, all_.size(), first_empty);
    }
    out.mean = mean_of(out.images);
    return out;
  }

  void write_report(const EvaluationReport& report) const {
    if (output_.empty() || !ranks_.leads() || report.images.empty()) return;
    write_text_file(output_ / "metrics.json", report.json());
  }

 private:
  const View& view(std::size_t i) const { return dataset_.views[views_[i]]; }
  std::shared_ptr<const ViewPicture> photo_of(std::size_t i) const {
    if (!options_.photo) return std::make_shared<const ViewPicture>(load_view_picture(view(i)));
    std::shared_ptr<const ViewPicture> photo = options_.photo(views_[i]);
    if (!photo) throw UsageError(fmt::format("There is no photo of {}", names_[i]));
    check_size(photo->rgba, view(i).camera, 4, "The photo of " + names_[i]);
    if (!photo->weight.data.empty())
      check_size(photo->weight, view(i).camera, 1, "The weight of the photo of " + names_[i]);
    return photo;
  }
  // Empty where it was stopped, and of pictures that another rank compares.
  Image rendered(std::size_t i, const Camera& camera) const {
    Image traced = render_(camera);
    if (!compares_ || traced.data.empty()) return {};
    check_size(traced, camera, 3, "The render of " + names_[i]);
    return traced;
  }
  std::string picture_of(std::size_t i) const { return names_[i] + ".png"; }
  // Beside the next comparison.
  void write_picture(std::size_t i, const Comparison& pair) {
    Image both = side_by_side(pair.photo, pair.render);
    const std::size_t bytes = sizeof(float) * both.data.size();
    files_.add(bytes, [path = output_ / picture_of(i), both = std::move(both)] {
      write_image(path, both);
    });
  }
  // Ranks that render together stop together.
  bool for_all(bool stop) const { return options_.together ? ranks_.all_reduce_or(stop) : stop; }

  Comparison compared(Image traced, const ViewPicture& picture) const {
    return compare(std::move(traced), picture, dataset_.alpha_is_background, background_);
  }

  // None where it was stopped, and of pictures that another rank compares.
  std::optional<Comparison> compare_view(std::size_t i) const {
    Image traced = rendered(i, view(i).camera);
    if (traced.data.empty()) return std::nullopt;
    return compared(std::move(traced), *photo_of(i));
  }

  // After compare_view(), whose pair that is; none where it was stopped.
  std::optional<double> aligned_psnr(std::size_t i, const Comparison& pair) const {
    const std::shared_ptr<const ViewPicture> photo = photo_of(i);
    const auto shown = [&](const Camera& camera) {
      Image traced = rendered(i, camera);
      if (!options_.align_colors || traced.data.empty()) return traced;
      return color_corrected(compared(std::move(traced), *photo).render, pair.photo, pair.mask);
    };
    std::optional<AlignedView> aligned = align_view(shown, view(i).camera, pair.photo, pair.mask);
    if (!aligned) return std::nullopt;
    return psnr_of(compared(std::move(aligned->render), *photo));
  }

  // Adds a view to those of this rank. Returns whether to go on.
  bool measure_view(std::size_t i, std::vector<MeasuredView>& own) {
    std::optional<Comparison> pair = compare_view(i);
    if (!pair) return !compares_;
    MeasuredView measured = measure(i, *pair, options_.lpips);
    if (all_shown_ && measured.compared) write_picture(i, *pair);
    if (options_.align && measured.compared) {
      const std::optional<double> aligned = aligned_psnr(i, *pair);
      if (!aligned) return false;
      measured.has_aligned = true;
      measured.psnr_aligned = *aligned;
    }
    own.push_back(measured);
    return !options_.done || options_.done(own.size());
  }

  const std::function<Image(const Camera&)>& render_;
  const Dataset& dataset_;
  const std::vector<std::size_t>& views_;
  std::vector<std::string> names_;
  std::array<float, 3> background_;
  const std::filesystem::path& output_;
  const EvaluationOptions& options_;
  Communicator alone_;
  Communicator& ranks_;
  bool compares_;             // what is rendered, with its photos
  std::size_t first_, step_;  // of the views that are this rank's
  std::size_t pictures_;      // at most
  bool all_shown_;            // as they are measured
  bool stopped_ = false;
  std::vector<MeasuredView> all_;
  std::set<std::size_t> shown_;  // whose pictures are written
  BackgroundTasks files_;
};

}  // namespace

std::vector<std::string> evaluated_names(const Dataset& dataset, Split split) {
  return names_of(dataset, dataset.indices(split));
}

EvaluationReport evaluate(const std::function<Image(const Camera&)>& render,
                          const Dataset& dataset,
                          Split split,
                          const std::array<float, 3>& background,
                          const std::filesystem::path& output,
                          const EvaluationOptions& options) {
  check_background(background);
  const std::vector<std::size_t> views = spread(dataset.indices(split), options.max_views);
  if (views.empty()) {
    throw UsageError(fmt::format(
        "The data set {} has no views to evaluate: choose another split, --test-every or "
        "--test-list",
        dataset.root.string()));
  }
  if (options.align && options.together)
    throw UsageError("Views that ranks render together cannot be aligned with their photos");
  if (!output.empty()) {
    std::error_code error;
    std::filesystem::create_directories(output, error);
    if (error)
      throw DataError(
          fmt::format("The folder {} cannot be created: {}", output.string(), error.message()));
  }
  Evaluation evaluation(render, dataset, views, background, output, options);
  evaluation.measure_views();
  evaluation.write_telling_pictures();
  EvaluationReport report = evaluation.report();
  evaluation.write_report(report);
  return report;
}

}  // namespace raysplats
