// SPDX-License-Identifier: Apache-2.0
// What moves or changes from photo to photo, as people and cars. A model that is trained on it
// shows it as haze and ghosts.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "eval/moving_areas.hpp"
#include "eval/photo_agreement.hpp"
#include "scene/image/planes.hpp"
#include "train/schedule.hpp"
#include "train/trainer_impl.hpp"
#include "util/parallel.hpp"

namespace raysplats {
namespace {

constexpr std::uint32_t kHalf = 0xffffu;  // of a word, which a float of a checkpoint holds exactly

// The photo's colours and how much each pixel counts, as the loss takes them.
struct CountedPhoto {
  Image colors, weight;
};

CountedPhoto counted_photo(const DevicePhoto& device,
                           const Camera& camera,
                           bool cut_out,
                           const std::array<float, 3>& background) {
  const io::Photo photo{camera.width, camera.height, device.planes, device.weighted,
                        device.words.download()};
  CountedPhoto out{Image(photo.width, photo.height, 3), Image(photo.width, photo.height, 1)};
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      const std::array<float, 4> pixel = photo.at(x, y);
      for (int c = 0; c < 3; ++c) {
        const auto k = static_cast<std::size_t>(c);
        out.colors.at(x, y, c) =
            cut_out ? pixel[3] * pixel[k] + (1 - pixel[3]) * background[k] : pixel[k];
      }
      out.weight.at(x, y, 0) = cut_out ? photo.weight(x, y) : pixel[3];
    }
  }
  return out;
}

// What store_moving() has written of so many photos.
std::vector<PixelMask> masks_of(std::span<const float> numbers, std::size_t photos) {
  const auto refuse = [] {
    throw DataError(
        "The checkpoint leaves out parts of photos that its run does not have: resume from "
        "another one");
  };
  const auto next = [&](std::uint32_t most) {
    if (numbers.empty() || !(numbers[0] >= 0 && numbers[0] <= static_cast<float>(most))) refuse();
    const auto out = static_cast<std::uint32_t>(numbers[0]);
    numbers = numbers.subspan(1);
    return out;
  };
  std::vector<PixelMask> out(photos);
  for (PixelMask& mask : out) {
    const auto width = static_cast<int>(next(kComparedSide)),
               height = static_cast<int>(next(kComparedSide));
    if ((width == 0) != (height == 0)) refuse();
    mask = PixelMask(width, height);
    for (std::uint32_t& word : mask.words) {
      word = next(kHalf);
      word |= next(kHalf) << 16;
    }
  }
  if (!numbers.empty()) refuse();
  return out;
}

}  // namespace

std::vector<PixelMask> Trainer::Impl::moving_views() {
  TraceOptions traced = trace_options();
  traced.depth = true;
  ViewTracer judge(context, traced);
  std::vector<ComparedPhoto> photos;
  std::vector<std::size_t> views;
  for (std::size_t view = 0; view < train_views.size(); ++view) {
    if (iteration < join_iteration() && std::binary_search(apart.begin(), apart.end(), view))
      continue;
    ComparedPhoto compared;
    compared.camera = compared_camera(poses ? poses->camera(view) : train_cameras[view]);
    const int width = compared.camera.width, height = compared.camera.height;
    judge.forward(gaussians, compared.camera);
    const CountedPhoto photo = counted_photo(photo_cache.get_whole(view, width, height),
                                             compared.camera, cut_out, background);
    const Image picture = interleaved(judge.image().download(), width, height, 3);
    compared.error = fitted_error(picture, photo.colors, photo.weight);
    const std::vector<float> depths = judge.depth().download();
    const auto pixels = static_cast<std::ptrdiff_t>(compared.error.size());
    compared.depth.assign(depths.begin() + pixels, depths.begin() + 2 * pixels);  // the median
    photos.push_back(std::move(compared));
    views.push_back(view);
  }
  std::vector<PixelMask> found = moving_areas(photos);
  std::vector<PixelMask> out(train_views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (count(found[i]) > 0) out[views[i]] = std::move(found[i]);
  }
  return out;
}

void Trainer::Impl::set_moving(std::vector<PixelMask> found) {
  for (std::size_t view = 0; view < found.size(); ++view) {
    if (found[view] != moving[view]) photo_cache.leave_out(view, found[view], cut_out);
  }
  moving = std::move(found);
}

// Completed iterations after which it is looked for the last time.
std::int64_t Trainer::Impl::last_look() const {
  const double share = moving_shares(options, loss_views()).back();
  return std::llround(share * static_cast<double>(options.iterations));
}

void Trainer::Impl::warn_of_late_look() const {
  if (!resumed || resumed->leave_out_moving || !options.leave_out_moving) return;
  if (iteration <= last_look()) return;
  spdlog::warn(
      "leave-out-moving comes too late: what moves is looked for until iteration {}, and this run "
      "goes on from {}; resume from an earlier checkpoint",
      last_look(), iteration);
}

// All ranks do what the first one finds.
void Trainer::Impl::leave_out_moving_areas() {
  finish_steps();
  std::vector<PixelMask> found(train_views.size());
  if (ranks.leads()) found = moving_views();
  for (PixelMask& mask : found) {
    mask.width = ranks.broadcast_value(0, mask.width);
    mask.height = ranks.broadcast_value(0, mask.height);
    mask.words.resize(ranks.broadcast_value(0, mask.words.size()));
    ranks.broadcast(std::as_writable_bytes(std::span(mask.words)));
  }
  set_moving(std::move(found));
  if (!ranks.leads()) return;
  double share = 0;
  std::size_t photos = 0;
  for (const PixelMask& mask : moving) {
    share += marked_share(mask) / static_cast<double>(moving.size());
    photos += mask.width > 0 ? 1 : 0;
  }
  const bool last = iteration >= last_look();
  if (last) write_moving();
  spdlog::log(last ? spdlog::level::info : spdlog::level::debug,
              "iteration {}: {:.1f} % of the training photos, in {} of {}, show what moves or "
              "changes, and are left out",
              iteration, 100 * share, photos, moving.size());
}

// Masks as data sets have them, to be looked at, mended and used.
void Trainer::Impl::write_moving() const {
  run.remove_moving();
  in_parallel(moving.size(), [&](std::size_t i) {
    if (moving[i].width == 0) return;
    const View& view = dataset.views[train_views[i]];
    run.write_moving(view.camera.name, counted_in_photo(moving[i], view));
  });
}

void Trainer::Impl::store_moving(CheckpointSections& sections) const {
  if (std::all_of(moving.begin(), moving.end(), [](const PixelMask& m) { return m.width == 0; }))
    return;
  sections["moving"] = [this] {
    std::vector<float> out;
    for (const PixelMask& mask : moving) {
      out.push_back(static_cast<float>(mask.width));
      out.push_back(static_cast<float>(mask.height));
      for (const std::uint32_t word : mask.words) {
        out.push_back(static_cast<float>(word & kHalf));
        out.push_back(static_cast<float>(word >> 16));
      }
    }
    return out;
  };
}

// A run that is told to train on what moves from here on does.
void Trainer::Impl::restore_moving(const Checkpoint& checkpoint) {
  const auto section = checkpoint.sections.find("moving");
  const bool has = section != checkpoint.sections.end() && options.leave_out_moving;
  set_moving(has ? masks_of(section->second, train_views.size())
                 : std::vector<PixelMask>(train_views.size()));
}

}  // namespace raysplats
