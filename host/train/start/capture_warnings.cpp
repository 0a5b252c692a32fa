// SPDX-License-Identifier: Apache-2.0
#include "train/start/capture_warnings.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <glm/vec2.hpp>
#include <utility>

#include "io/dataset/dataset_photos.hpp"
#include "scene/even_choice.hpp"
#include "train/capture_geometry.hpp"
#include "train/start/grey_photos.hpp"
#include "train/start/still_ground.hpp"
#include "train/start/still_marks.hpp"
#include "util/number_text.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kNamed = 3;  // photos that a warning is about

// What to do about marks of the photo of a view.
std::string without_marks(const Dataset& dataset,
                          std::span<const StillMark> marks,
                          const SmallPhoto& photo,
                          const View& view) {
  if (dataset.alpha_is_background) return "leave it out by masks that are black there";
  std::vector<PhotoArea> areas = view.ignored;
  for (const StillMark& mark : marks)
    areas.push_back(area_of(mark, photo.camera, view.source_camera));
  return fmt::format("leave it out by --ignore-areas '{}'", io::text_of(areas));
}

}  // namespace

std::string strays_warning(std::span<const Camera> cameras) {
  const std::vector<std::size_t> strays = stray_cameras(cameras);
  if (strays.empty()) return "";
  return fmt::format(
      "{} of {} training views were taken far from all others, {} among them: learning rates and "
      "sizes leave them out; where their poses are wrong, take the photos out of the data set",
      strays.size(), cameras.size(), cameras[strays.front()].name);
}

// Pictures of a rig are named frame by frame: where the number of its lenses is a multiple of the
// step, counting holds out the same lenses of every frame.
std::string direction_warning(const Dataset& dataset,
                              std::span<const Camera> held_out,
                              std::span<const Camera> trained) {
  if (dataset.test_every == 0 || !look_elsewhere(held_out, trained)) return "";
  const auto no_better = [&](std::size_t every) {
    std::vector<Camera> multiples, others;
    for (std::size_t i = 0; i < dataset.views.size(); ++i)
      (i % every == 0 ? multiples : others).push_back(dataset.views[i].camera);
    return look_elsewhere(multiples, others);
  };
  // Ends at the latest where less than three views are held out.
  auto better = static_cast<std::size_t>(dataset.test_every) + 1;
  while (no_better(better)) ++better;
  return fmt::format(
      "most of the {} held-out photos look where no training photo does (is one in {} always of "
      "the same lens of a rig?): the model lacks what they show, and metrics judge it there alone; "
      "--test-every {} holds out photos of other lenses as well",
      held_out.size(), dataset.test_every, better);
}

std::string grey_warning(std::span<const SmallPhoto> read, std::size_t all) {
  const std::vector<std::size_t> grey = grey_photos(read);
  if (grey.empty()) return "";
  std::string names;
  for (const std::size_t i : even_choice(grey.size(), kNamed))
    names += (names.empty() ? "" : ", ") + read[grey[i]].camera.name;
  return fmt::format(
      "{} of {} {} photos have no colour where others show some, {} among them: grey is learned "
      "from these, so give them with their colours or take them out of the data set",
      grey.size(), read.size(), all > read.size() ? "looked-at" : "training", names);
}

std::string masks_warning(const Dataset& dataset, const MaskedOut& masked) {
  if (masked.photos == 0) return "";
  spdlog::debug(
      "masks leave out {:.1f} % of {} places of sparse points, {:.1f} % of the pixels, {:.1f} % of "
      "the edges, and photos agree on {:.1f} % of what they keep",
      100 * masked.points, masked.seen, 100 * masked.pixels, 100 * masked.edge,
      100 * masked.agreed);
  if (!masked.inverted()) return "";
  const bool told = masked.points > 0;
  const auto has_mask = [](const View& view) { return !view.mask_path.empty(); };
  const auto first = std::find_if(dataset.views.begin(), dataset.views.end(), has_mask);
  return fmt::format(
      "the masks, {} among them, seem to be inverted: they leave out {:.0f} % of {}; give masks "
      "that are black where photos are to be left out",
      first->mask_path.string(), 100 * (told ? masked.points : masked.pixels),
      told ? "the places where photos show sparse points"
           : "the photos, and what they keep lies elsewhere in each");
}

std::vector<SmallPhoto> photos_for_marks(const Dataset& dataset,
                                         std::span<const std::size_t> views,
                                         const ReadingProgress& progress) {
  Dataset chosen;
  std::vector<std::size_t> all;
  for (const std::size_t i : views) {
    View view = dataset.views[i];
    const Camera& source = view.source_camera;
    const int side = std::max(view.camera.width, view.camera.height);
    const int most = std::min(kMarkSide, std::max(source.width, source.height));
    if (side < most) view.camera = downscaled(view.camera, static_cast<double>(side) / most);
    all.push_back(all.size());
    chosen.views.push_back(std::move(view));
  }
  return load_small_photos(chosen, all, kMarkSide, progress);
}

std::string marks_warning(const Dataset& dataset,
                          std::span<const SmallPhoto> read,
                          std::span<const std::size_t> views) {
  if (const auto ground = still_ground(read)) {
    return fmt::format(
        "{:.0f} % of the edges in photos stand at the same pixels of {} of {} of them, though by "
        "their poses the cameras moved: what stands behind a turntable, or goes along with the "
        "camera, is learned as haze; leave it out by masks that are black there, or by "
        "--ignore-areas",
        100 * ground->edges, ground->photos, read.size());
  }
  const std::vector<StillMark> marks = still_marks(read);
  if (marks.empty()) return "";
  const StillMark& mark = marks.front();
  const auto photo = std::find_if(read.begin(), read.end(), [&](const SmallPhoto& each) {
    return glm::ivec2(each.picture->width, each.picture->height) == mark.size;
  });
  const View& view = dataset.views[views[static_cast<std::size_t>(photo - read.begin())]];
  const glm::dvec2 size(mark.size);
  const glm::dvec2 low = 100.0 * glm::dvec2(mark.low) / size;
  const glm::dvec2 high = 100.0 * glm::dvec2(mark.high + 1) / size;
  return fmt::format(
      "something stands at the same pixels of all photos, as a logo, a date or what does not turn "
      "with a turntable: {}from {:.0f} to {:.0f} % of their width and from {:.0f} to {:.0f} % of "
      "their height (from the top left); it is learned as a part of the scene, so crop it off, or "
      "{}",
      marks.size() > 1 ? fmt::format("in {} places, the clearest ", marks.size()) : "", low.x,
      high.x, low.y, high.y, without_marks(dataset, marks, *photo, view));
}

std::string crowds_warning(const CrowdedPlaces& crowded,
                           std::span<const Camera> trained,
                           std::span<const Camera> held_out) {
  if (crowded.places.empty()) return "";
  std::size_t photos = 0;
  for (const CrowdedPlace& place : crowded.places) photos += place.photos.size();
  const auto copies = std::ranges::count_if(held_out, [&](const Camera& camera) {
    return std::ranges::any_of(crowded.places, [&](const CrowdedPlace& place) {
      return from_one_place(trained[place.photos.front()], camera, place.distance);
    });
  });
  return fmt::format(
      "{} of {} training photos are from {}, as where a video stands still: together they are "
      "drawn as often as {} others (--no-even-places draws each as often as any){}",
      photos, trained.size(), counted(crowded.places.size(), "place"),
      crowded.most * crowded.places.size(),
      copies == 0 ? ""
                  : fmt::format("; {} of {} held-out photos are from there too, and tell how well "
                                "the model knows photos that it has seen",
                                copies, held_out.size()));
}

}  // namespace raysplats
