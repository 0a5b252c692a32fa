// SPDX-License-Identifier: Apache-2.0
#include "train/train_config.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <functional>
#include <set>
#include <sstream>
#include <string_view>

#include "base/nearest_name.hpp"
#include "raysplats/error.hpp"
#include "train/train_keys.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kCommentWidth = 110;

// Sets every key of the file for which `skip` is false; returns the names of all.
std::set<std::string> read_keys(const std::filesystem::path& path,
                                TrainOptions& options,
                                const std::function<bool(const std::string&)>& skip) {
  std::ifstream stream(path);
  if (!stream.good()) {
    throw UsageError(
        fmt::format("The configuration file {} cannot be read: check the path", path.string()));
  }
  std::vector<CLI::ConfigItem> items;
  try {
    items = CLI::ConfigTOML().from_config(stream);
  } catch (const CLI::Error& error) {
    throw UsageError(fmt::format("The configuration file {} is not valid TOML: {}", path.string(),
                                 error.what()));
  }
  const std::vector<TrainKey> keys = train_keys(options);
  std::set<std::string> names_found;
  for (const CLI::ConfigItem& item : items) {
    if (item.name == "++" || item.name == "--")
      continue;  // CLI11's marks for the begin and end of a table
    const bool known_table =
        item.parents.empty() || (item.parents.size() == 1 && item.parents[0] == "train");
    const auto key = std::find_if(keys.begin(), keys.end(), [&](const TrainKey& candidate) {
      return candidate.name == item.name;
    });
    if (!known_table || key == keys.end()) {
      std::vector<std::string> names;
      names.reserve(keys.size());
      for (const TrainKey& candidate : keys) names.push_back(candidate.name);
      throw UsageError(fmt::format("Unknown key '{}' in {}: did you mean '{}'?", item.fullname(),
                                   path.string(), nearest_name(item.name, names)));
    }
    names_found.insert(item.name);
    if (skip(item.name)) continue;
    try {
      key->set(item.inputs);
    } catch (const UsageError& error) {
      throw UsageError(fmt::format("{} ({})", error.what(), path.string()));
    }
  }
  return names_found;
}

// The text in lines of comment.
std::string comment(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    std::size_t length = text.size();
    if (length > kCommentWidth) length = text.rfind(' ', kCommentWidth);
    out += fmt::format("# {}\n", text.substr(0, length));
    text.remove_prefix(std::min(text.size(), length + 1));
  }
  return out;
}

}  // namespace

void add_train_options(CLI::App& app, TrainOptions& options) {
  for (const TrainKey& key : train_keys(options)) {
    const std::string flag = "--" + key.name;
    CLI::Option* option = nullptr;
    if (key.flag) {
      const auto set = key.set;
      option = app.add_flag_function(
          fmt::format("{},!--no-{}", flag, key.name),
          [set](std::int64_t count) { set({count > 0 ? "true" : "false"}); }, key.help);
    } else {
      option = app.add_option_function<std::vector<std::string>>(
          key.name == "iterations" ? "-n," + flag
          : key.name == "mirrors"  ? "--mirror," + flag
                                   : flag,
          key.set, key.help);
      option->default_str(key.text())->type_name("")->expected(1);
      option->multi_option_policy(key.repeatable ? CLI::MultiOptionPolicy::TakeAll
                                                 : CLI::MultiOptionPolicy::TakeLast);
    }
    option->group(key.section);
  }
  app.add_option("--config", "configuration file (TOML); options on the command line go before it")
      ->expected(1)
      ->group("Run");
  app.parse_complete_callback([&app, &options] {
    const CLI::Option* config = app.get_option("--config");
    if (config->count() > 0) apply_config_file(app, options, config->as<std::string>());
    validate(options);
  });
}

void apply_config_file(CLI::App& app, TrainOptions& options, const std::filesystem::path& path) {
  read_keys(path, options,
            [&app](const std::string& key) { return app.get_option("--" + key)->count() > 0; });
}

void apply_run_config(CLI::App& app, TrainOptions& options, const std::filesystem::path& path) {
  const auto given = [&app](const std::string& key) {
    return app.get_option("--" + key)->count() > 0;
  };
  const std::set<std::string> found = read_keys(path, options, given);
  if (found.count("strategy") > 0) return;
  // The run is older than these keys: it goes on as it began.
  if (!given("strategy")) options.strategy = DensityStrategy::kAdc;
  if (!given("footprint")) options.footprint = 0;
}

void read_train_config(const std::filesystem::path& path, TrainOptions& options) {
  read_keys(path, options, [](const std::string&) { return false; });
  validate(options);
}

std::string to_toml(const TrainOptions& options) {
  TrainOptions copy = options;
  std::string out;
  std::string section;
  for (const TrainKey& key : train_keys(copy)) {
    if (key.section != section) {
      section = key.section;
      out += fmt::format("{}# ---- {} ----\n", out.empty() ? "" : "\n", section);
    }
    out += fmt::format("{}{} = {}\n", comment(key.help), key.name, key.text());
  }
  return out;
}

void validate(const TrainOptions& options) {
  const int width = options.packet_width;
  if (width != 0 && width != 1 && width != 2 && width != 4 && width != 8 && width != 16) {
    throw UsageError(
        fmt::format("The option 'packet-width' is 0, 1, 2, 4, 8 or 16, not {}", width));
  }
  const auto& sizes = options.resolution_schedule;
  const auto earlier = [&options](const ResolutionStep& a, const ResolutionStep& b) {
    return a.until.of(options.iterations) < b.until.of(options.iterations);
  };
  if (!std::is_sorted(sizes.begin(), sizes.end(), earlier)) {
    throw UsageError("The iterations of 'resolution-schedule' have to ascend");
  }
  for (const LearningRate& rate : {options.position_lr, options.rotation_lr, options.scale_lr,
                                   options.opacity_lr, options.sh_lr, options.sh_rest_lr}) {
    if ((rate.initial > 0) != (rate.final_value > 0)) {
      throw UsageError(
          "A learning rate and its final value are both 0 (the group stays as it is) or both above "
          "0");
    }
  }
  if (options.deterministic && options.gradient_sum == GradientSum::kAtomic) {
    throw UsageError(
        "The options 'deterministic' and 'gradient-sum' = atomic contradict each other, because "
        "atomic sums depend on the scheduling: use 'gradient-sum' = auto or leave 'deterministic' "
        "off");
  }
  if (options.background != "random") background_color(options, false);
}

std::array<float, 3> background_color(const TrainOptions& options, bool cut_out) {
  const std::string& text = options.background;
  if (text == "auto" || text == "random") {
    const float value = cut_out ? 1.0f : 0.0f;
    return {value, value, value};
  }
  std::array<float, 3> color{};
  std::istringstream stream(text);
  char comma[2] = {};
  stream >> color[0] >> comma[0] >> color[1] >> comma[1] >> color[2];
  const bool in_range =
      std::all_of(color.begin(), color.end(), [](float c) { return c >= 0.0f && c <= 1.0f; });
  if (stream.fail() || !(stream >> std::ws).eof() || comma[0] != ',' || comma[1] != ',' ||
      !in_range) {
    throw UsageError(
        fmt::format("The option 'background' is auto, random or three numbers from 0 to 1 such as "
                    "1,1,1, not '{}'",
                    text));
  }
  return color;
}

}  // namespace raysplats
