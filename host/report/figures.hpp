// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace raysplats::report {

/// A picture of photo, render and error side by side, as a page shows it.
struct Figure {
  std::filesystem::path file;  ///< empty when there is none, which the page says
  std::string name, caption;
};

/// Figures as HTML. However large their files are, all pictures of a call take some 2 MB of the
/// page: panels have at most 480 pixels a side, and less, at a lower quality, where many or noisy
/// ones ask for more. For a picture that cannot be read the reason stands in its place.
std::string figures(std::span<const Figure> figures);

}  // namespace raysplats::report
