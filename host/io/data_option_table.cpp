// SPDX-License-Identifier: Apache-2.0
#include "io/data_option_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>

#include "io/data_origin.hpp"
#include "raysplats/error.hpp"
#include "util/number_text.hpp"

namespace raysplats {
namespace {

constexpr double kMostDownscale = 1024;

void add_downscale_option(OptionTable& table, DatasetOptions& options) {
  table.add(
      "downscale",
      "image sizes are divided by this; auto = 1, but to train on photos that are more than a "
      "quarter larger than 1600 pixels on their longer side (with --time on fewer, by the time) "
      "what reduces them to that, which the run's configuration then names",
      [&options](const OptionTable::Values& values) {
        const std::string& value = option_value("downscale", values);
        options.downscale =
            value == "auto" ? 0 : option_number<double>("downscale", value, 1, kMostDownscale);
      },
      [&options] {
        return options.downscale == 0 ? toml_text("auto") : fmt::format("{}", options.downscale);
      });
}

void add_origin_option(OptionTable& table, DatasetOptions& options) {
  table.add(
      "origin",
      "\"x,y,z\" in the data set's coordinates, from which the model's positions count; \"auto\" = "
      "0, but near the cameras where the scene lies so far from 0 that single precision would blur "
      "it (surveyed captures), which the run's configuration then names",
      [&options](const OptionTable::Values& values) {
        if (values.size() == 1 && values.front() == "auto") {
          options.origin.reset();
          return;
        }
        const std::vector<std::string> parts = option_items("origin", values);
        std::array<double, 3> origin{};
        for (std::size_t k = 0; k < parts.size() && k < origin.size(); ++k)
          origin[k] =
              option_number<double>("origin", parts[k], -io::kFarthestOrigin, io::kFarthestOrigin);
        if (parts.size() != origin.size()) {
          throw UsageError(fmt::format("The option 'origin' is auto or three numbers, not '{}'",
                                       fmt::join(values, " ")));
        }
        options.origin = origin;
      },
      [&options] {
        if (!options.origin) return std::string("\"auto\"");
        return fmt::format("[{}]", fmt::join(*options.origin, ", "));
      });
}

}  // namespace

void add_data_options(OptionTable& table, DatasetOptions& options) {
  add_downscale_option(table, options);
  table.number("test-every", options.test_every, 0, 1e9,
               "every n-th view is held out when the data set has no split of its own; 0 = none");
  table.flag("undistort", options.undistort,
             "turn photos through lenses with OpenCV distortion into pinhole pictures; false = "
             "their own pixels and rays");
  table.choice<MaskUse>(
      "masks", options.masks, {{"ignore", MaskUse::kIgnore}, {"cutout", MaskUse::kCutout}},
      "what is black in the photos' masks: ignore (it counts neither in the loss nor in metrics) "
      "or cutout (background, as transparent pixels are)");
  table.choice<AlphaUse>(
      "alpha", options.alpha,
      {{"auto", AlphaUse::kAuto}, {"ignore", AlphaUse::kIgnore}, {"cutout", AlphaUse::kCutout}},
      "what is transparent in photos: ignore (it counts neither in the loss nor in metrics), "
      "cutout (background) or auto (cutout where most photos have something transparent, but for "
      "holes and a border that is the same in all)");
  table.choice<BorderUse>(
      "borders", options.borders, {{"auto", BorderUse::kAuto}, {"keep", BorderUse::kKeep}},
      "black borders that all photos have, as the bars of a video or around the circle of a "
      "fisheye: auto (they count neither in the loss nor in metrics) or keep (they are a part of "
      "the scene)");
  add_origin_option(table, options);
}

std::vector<OptionRow> data_option_rows(DatasetOptions& options) {
  OptionTable table;
  add_data_options(table, options);
  return table.take();
}

}  // namespace raysplats
