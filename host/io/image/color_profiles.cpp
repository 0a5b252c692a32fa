// SPDX-License-Identifier: Apache-2.0
#include "io/image/color_profiles.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "io/image/image_file.hpp"
#include "io/image/image_header.hpp"
#include "raysplats/error.hpp"
#include "scene/even_choice.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kPhotos = 5;

/// Whether a profile is sRGB by its name: all say so but two that were made to be small.
bool is_srgb(std::string_view profile) {
  return profile.find("sRGB") != std::string_view::npos || profile == "c2" || profile == "uRGB";
}

std::string profile_of(const View& view) {
  try {
    return color_profile(view.image_path);
  } catch (const Error&) {
    return {};  // who needs the photo says what is wrong with it
  }
}

/// What says that the colours of a photo are other than sRGB's; "" where nothing does.
std::string other_colors(const View& view) {
  // sRGB's is 1 / 2.2.
  constexpr double kLeastGamma = 0.4, kMostGamma = 0.5;
  const std::string profile = profile_of(view);
  if (!profile.empty() && !is_srgb(profile)) return fmt::format("the profile '{}'", profile);
  const std::optional<double> gamma = png_gamma(view.image_path);
  if (!gamma || (*gamma >= kLeastGamma && *gamma <= kMostGamma)) return {};
  return fmt::format("a gAMA of {:.2f}, as light has 1 and sRGB 0.45,", *gamma);
}

}  // namespace

void warn_of_color_profiles(std::span<const View> views) {
  for (const std::size_t i : even_choice(views.size(), kPhotos)) {
    const View& view = views[i];
    const std::string colors = other_colors(view);
    if (colors.empty()) continue;
    spdlog::warn(
        "The colours of {} are those of {} but are taken as sRGB, so that a viewer "
        "shows the model in other colours than the photos: convert the photos to sRGB where that "
        "matters",
        view.image_path.string(), colors);
    return;
  }
}

}  // namespace raysplats::io
