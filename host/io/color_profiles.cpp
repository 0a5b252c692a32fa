// SPDX-License-Identifier: Apache-2.0
#include "io/color_profiles.hpp"

#include <spdlog/spdlog.h>

#include <cstddef>
#include <string>
#include <string_view>

#include "io/image_file.hpp"
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

}  // namespace

void warn_of_color_profiles(std::span<const View> views) {
  for (const std::size_t i : even_choice(views.size(), kPhotos)) {
    const View& view = views[i];
    const std::string profile = profile_of(view);
    if (profile.empty() || is_srgb(profile)) continue;
    spdlog::warn(
        "The colours of {} are those of the profile '{}' but are taken as sRGB, so that a viewer "
        "shows the model in other colours than the photos: convert the photos to sRGB where that "
        "matters",
        view.image_path.string(), profile);
    return;
  }
}

}  // namespace raysplats::io
