// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/data_option_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "io/dataset/data_origin.hpp"
#include "io/dataset/dataset_photos.hpp"
#include "io/dataset/test_list.hpp"
#include "raysplats/error.hpp"
#include "util/number_text.hpp"
#include "util/utf8.hpp"

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

// What of a list configurations, which keep the names, cannot hold; "" where they can.
std::string unstorable(const std::string& text) {
  constexpr std::size_t kMostBytes = std::size_t{1} << 18;  // checkpoints hold a configuration too
  if (text.size() > kMostBytes)
    return fmt::format("has {} bytes of names, more than {}", text.size(), kMostBytes);
  if (!is_utf8(text)) return "is not of UTF-8, but of UTF-16 or no text";
  const auto is_control = [](char c) {
    return (static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t') || c == 0x7f;
  };
  if (std::any_of(text.begin(), text.end(), is_control))
    return "has control characters, as files of UTF-16 or no text do";
  if (text.find(kTomlLines) != std::string::npos)
    return fmt::format("has {} in a name", kTomlLines);
  return "";
}

// `place`: what gives the names.
const std::set<std::string>& storable(const std::set<std::string>& names,
                                      const std::string& place) {
  const std::string reason = unstorable(io::text_of(names));
  if (reason.empty()) return names;
  throw UsageError(
      fmt::format("{} {}: 'test-list' is a text file of UTF-8 with a photo's name in each line",
                  place, reason));
}

void add_test_list_option(OptionTable& table, DatasetOptions& options) {
  table.add(
      "test-list",
      "text file with the names of the photos that are held out, one a line, in place of those "
      "that test-every and files of the data set say; the run's configuration then has the names "
      "themselves",
      [&options](const OptionTable::Values& values) {
        const std::string& value = option_value("test-list", values);
        options.test_list.reset();
        if (value.empty()) return;
        const bool is_list = value.find('\n') != std::string::npos;
        options.test_list = is_list ? storable(io::names_in(value), "The list of test photos")
                                    : storable(read_test_list(value), value);
      },
      [&options] {
        return options.test_list ? toml_lines(io::text_of(*options.test_list)) : toml_text("");
      });
}

void add_ignore_areas_option(OptionTable& table, DatasetOptions& options) {
  constexpr std::size_t kNumbers = 4;
  table.add(
      "ignore-areas",
      "boxes of the photos that count neither in the loss nor in metrics, such as a logo or a "
      "date: left, top, right and bottom of each, in shares of width and height from the top left",
      [&options](const OptionTable::Values& values) {
        const std::vector<std::string> parts = option_items("ignore-areas", values);
        if (parts.size() % kNumbers != 0) {
          throw UsageError(
              fmt::format("The option 'ignore-areas' has 4 numbers for each box (left, top, right, "
                          "bottom), not {} in all",
                          parts.size()));
        }
        const auto share = [&](std::size_t i) {
          return option_number<double>("ignore-areas", parts[i], 0, 1);
        };
        std::vector<PhotoArea> areas;
        for (std::size_t i = 0; i < parts.size(); i += kNumbers)
          areas.push_back({share(i), share(i + 1), share(i + 2), share(i + 3)});
        io::check_areas(areas);
        options.ignore_areas = std::move(areas);
      },
      [&options] { return fmt::format("[{}]", io::text_of(options.ignore_areas)); },
      OptionRow::List::kNumbers);
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
  add_test_list_option(table, options);
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
  add_ignore_areas_option(table, options);
  add_origin_option(table, options);
}

std::vector<OptionRow> data_option_rows(DatasetOptions& options) {
  OptionTable table;
  add_data_options(table, options);
  return table.take();
}

void refuse_two_splits() {
  throw UsageError("--test-every and --test-list contradict each other: leave one of them out");
}

DatasetOptions DataSettings::over(DatasetOptions base) const {
  if (has("test-every")) {
    if (has("test-list")) refuse_two_splits();
    base.test_list.reset();
  }
  return GivenOptions::over(std::move(base));
}

}  // namespace raysplats
