// SPDX-License-Identifier: Apache-2.0
#include "run/train_config.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>

#include "io/toml_table.hpp"
#include "raysplats/error.hpp"
#include "run/checkpoint.hpp"
#include "run/train_option_table.hpp"
#include "scene/options/option_flags.hpp"
#include "scene/options/trace_option_table.hpp"
#include "util/file_kind.hpp"
#include "util/nearest_name.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kCommentWidth = 110;
constexpr char kRunConfig[] = "config.toml";
constexpr char kCheckpointConfig[] = "the checkpoint's configuration";

// The first line of what to_toml() writes.
constexpr std::string_view kRunMark = "# ---- Run ----\n";

// A file that a run wrote, in the dialect of older versions: strings without escapes and seeds
// beyond the integers of TOML.
std::string modern(const std::string& text) {
  std::string out;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size() - 1) + 1;
    const std::string_view line = std::string_view(text).substr(begin, end - begin);
    constexpr std::string_view kSeed = "seed = ";
    constexpr std::size_t kMostDigits = 18;
    if (line.starts_with(kSeed)) {
      const std::size_t digits = line.find_first_not_of("0123456789", kSeed.size());
      const std::size_t last = std::min(digits, line.size());
      if (last - kSeed.size() > kMostDigits) {
        out += fmt::format("{}\"{}\"{}", kSeed, line.substr(kSeed.size(), last - kSeed.size()),
                           line.substr(last));
        begin = end;
        continue;
      }
    }
    const bool bare = !line.starts_with('#') && line.find('\'') == std::string_view::npos;
    for (const char c : line) {
      if (c == '\\' && bare) out += c;
      out += c;
    }
    begin = end;
  }
  return out;
}

std::string file_text(const std::filesystem::path& path) {
  try {
    return io::read_toml_text(path);
  } catch (const DataError& error) {
    throw UsageError(fmt::format("The configuration file cannot be read: {}", error.what()));
  }
}

std::vector<std::string> names_of(const std::vector<OptionRow>& keys) {
  std::vector<std::string> names;
  names.reserve(keys.size());
  for (const OptionRow& key : keys) names.push_back(key.name);
  return names;
}

// Sets every key of a table for which `skip` is false; `prefix` is how the file calls the table.
void read_keys(const toml::table& table,
               const std::string& prefix,
               const std::filesystem::path& path,
               const std::vector<OptionRow>& keys,
               std::set<std::string>& seen,
               const std::function<bool(const std::string&)>& skip) {
  for (const auto& [written, node] : table) {
    const std::string name = io::dashed(written.str());
    const auto fail = [&, &node = node](const std::string& message) {
      throw UsageError(
          fmt::format("{}, line {}: {}", path.string(), node.source().begin.line, message));
    };
    if (prefix.empty() && name == "train" && node.is_table()) {
      read_keys(*node.as_table(), "train.", path, keys, seen, skip);
      continue;
    }
    const auto key = std::find_if(keys.begin(), keys.end(), [&](const OptionRow& candidate) {
      return candidate.name == name;
    });
    if (key == keys.end() && (node.is_table() || node.is_array_of_tables())) {
      fail(fmt::format(
          "the table [{}{}] is unknown: keys stand at the top of the file or below [train]", prefix,
          written.str()));
    }
    if (key == keys.end() && take_retired_key(name)) continue;
    if (key == keys.end()) {
      fail(fmt::format("unknown key '{}{}'{}", prefix, written.str(),
                       did_you_mean(name, names_of(keys), ": 'raysplats train -h' lists all")));
    }
    if (!seen.insert(name).second) fail(fmt::format("'{}' is there twice: leave one out", name));
    const std::optional<std::vector<std::string>> values = io::value_texts(node);
    if (!values) {
      fail(fmt::format(
          "'{}' takes no {}", name,
          node.is_array() ? "list of lists, tables or dates" : io::type_name(node).substr(2)));
    }
    if (skip(name)) continue;
    try {
      key->set(*values);
    } catch (const UsageError& error) {
      fail(error.what());
    }
  }
}

// Returns the names of all keys that are there.
std::set<std::string> read_text(const std::string& text,
                                const std::filesystem::path& path,
                                TrainOptions& options,
                                const std::function<bool(const std::string&)>& skip) {
  const bool of_run = text.starts_with(kRunMark);
  const toml::table root = io::parse_toml(of_run ? modern(text) : text, path);
  std::set<std::string> seen;
  read_keys(root, "", path, train_option_rows(options), seen, skip);
  // Before there was the key.
  if (of_run && !seen.contains("borders") && !skip("borders"))
    options.data.borders = BorderUse::kKeep;
  if (of_run && !seen.contains("view-footprint") && !skip("view-footprint"))
    options.trace.view_footprint = 0;
  return seen;
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

// A value of TOML as a word for a shell.
std::string shell_text(std::string text) {
  if (text == "[]") return text;
  std::erase_if(text, [](char c) { return c == '"' || c == '[' || c == ']' || c == ' '; });
  return text;
}

void check_rate(const LearningRate& rate) {
  if ((rate.initial > 0) == (rate.final_value > 0)) return;
  throw UsageError(
      "A learning rate and its final value are both 0 (the group stays as it is) or both above 0");
}

void check_fitted(const char* name, double value, double least) {
  if (value >= least || value == kFitted) return;
  throw UsageError(fmt::format(
      "The option '{}' is {}: use {} or above, or -1 for what fits the start", name, value, least));
}

void check_fitted_rate(const LearningRate& rate) {
  for (const double value : {rate.initial, rate.final_value}) {
    if (value >= 0 || value == kFitted) continue;
    throw UsageError(fmt::format(
        "A learning rate is {}: use 0 or above, or -1 for one that fits the run", value));
  }
  const double initial = std::abs(rate.initial);
  if (rate.final_value != kFitted) check_rate({initial, rate.final_value});
}

// Checks the end of a rate that begins as it is given.
void check_fitted_end(const LearningRate& rate) {
  check_rate({rate.initial, rate.final_value == kFitted ? rate.initial : rate.final_value});
}

// Whether the command line has an option of that name, or one that says the same in another way: a
// list of test photos in a file would go before the number there.
std::function<bool(const std::string&)> given_on(const CLI::App& app) {
  return [&app](const std::string& key) {
    const auto given = [&](const std::string& name) { return app.get_option(name)->count() > 0; };
    return given("--" + key) || (key == "test-list" && given("--test-every"));
  };
}

// Sets the keys of --config that are not on the command line and not in `chosen`. Returns the names
// of all but these.
std::set<std::string> apply_given_config(CLI::App& app,
                                         TrainOptions& options,
                                         const std::set<std::string>& chosen = {}) {
  const CLI::Option* config = app.get_option("--config");
  if (config->count() == 0) return {};
  const std::filesystem::path path = config->as<std::string>();
  const auto given = given_on(app);
  std::set<std::string> named =
      read_text(file_text(path), path, options,
                [&](const std::string& key) { return chosen.contains(key) || given(key); });
  // Its number counts as that of the command line does: in place of a run's list.
  if (named.contains("test-every") && !named.contains("test-list") && !given("test-list"))
    options.data.test_list.reset();
  for (const std::string& key : chosen) named.erase(key);
  return named;
}

// What a run wrote of its options, but for keys in `anew`; where it could not name them, what they
// were then.
void apply_run_text(CLI::App& app,
                    TrainOptions& options,
                    const std::string& text,
                    const std::filesystem::path& path,
                    const std::set<std::string>& anew) {
  const auto given = [&, on_line = given_on(app)](const std::string& key) {
    return anew.contains(key) || on_line(key);
  };
  const std::set<std::string> found = read_text(text, path, options, given);
  if (found.count("origin") == 0 && !given("origin")) options.data.origin.emplace();
  if (found.count("raise-clamped") == 0 && !given("raise-clamped")) options.raise_clamped = false;
  if (found.count("borders") == 0 && !given("borders")) options.data.borders = BorderUse::kKeep;
  if (found.count("photo-points") == 0 && !given("photo-points")) options.photo_points = false;
  if (found.count("uncovered-points") == 0 && !given("uncovered-points"))
    options.uncovered_points = options.photo_points;  // one key had been for both
  if (found.count("color-range") == 0 && !given("color-range")) options.color_range = 1;
  if (found.count("alpha-weight") == 0 && !given("alpha-weight")) options.alpha_weight = 0;
  if (found.count("prune-weight") == 0 && !given("prune-weight")) options.prune_weight = 0;
  if (found.count("strategy") > 0) return;
  // The run is older than these keys: it goes on as it began.
  if (!given("strategy")) options.strategy = DensityStrategy::kAdc;
  if (!given("footprint")) options.footprint = 0;
}

// What the run goes on with besides what it had: "iterations 48000 (1500), seed 8 (7)". What the
// photos choose, of which its configuration names the choice, stays as it was chosen; what is
// chosen `anew` it does not have any more.
std::string changes(TrainOptions before, TrainOptions after, const std::set<std::string>& anew) {
  const std::vector<OptionRow> were = train_option_rows(before), are = train_option_rows(after);
  std::string out;
  for (std::size_t i = 0; i < are.size(); ++i) {
    const std::string was = were[i].text(), is = are[i].text();
    const bool fitted = is == toml_text("auto") || (are[i].name == "color-range" && is == "0") ||
                        (are[i].name == "iterations" && after.iterations == kFittedLength);
    if (was != is && !fitted && !anew.contains(are[i].name))
      out += fmt::format("{}{} {} ({})", out.empty() ? "" : ", ", are[i].name, brief_value(is),
                         brief_value(was));
  }
  return out;
}

}  // namespace

void add_train_options(CLI::App& app, TrainOptions& options) {
  for (const OptionRow& key : train_option_rows(options)) {
    const char* names = key.name == "iterations" ? "-n" : key.name == "mirrors" ? "--mirror" : "";
    CLI::Option* option = add_row(app, key, key.set, names);
    option->default_str(shell_text(key.text()))->group(key.section);
  }
  for (const RetiredKey& key : retired_train_keys()) {
    app.add_option_function<std::vector<std::string>>(
           "--" + key.name, [name = key.name](const auto&) { take_retired_key(name); })
        ->expected(1)
        ->group("");
  }
  app.add_option("--config", "configuration file (TOML); options on the command line go before it")
      ->expected(1)
      ->group("Run");
  app.parse_complete_callback([&app, &options] {
    // What a resumed run says counts less than the file, and is not known yet.
    const CLI::Option* resume = app.get_option_no_throw("--resume");
    if (resume != nullptr && resume->count() > 0) return;
    apply_given_config(app, options);
    validate(options);
  });
}

void apply_resumed_options(CLI::App& app,
                           TrainOptions& options,
                           const std::filesystem::path& source,
                           const std::set<std::string>& chosen,
                           const std::set<std::string>& anew) {
  const std::optional<std::filesystem::path> run = run_folder_of(source);
  bool known = true;
  if (run && is_file(*run / kRunConfig)) {
    apply_run_text(app, options, file_text(*run / kRunConfig), *run / kRunConfig, anew);
  } else if (const std::string text = checkpoint_config(source); !text.empty()) {
    apply_run_text(app, options, text, kCheckpointConfig, anew);
  } else {
    known = false;
  }
  const TrainOptions before = options;
  const std::set<std::string> named = apply_given_config(app, options, chosen);
  // What the command line itself says is no surprise.
  if (const std::string other = changes(before, options, anew); known && !other.empty())
    spdlog::warn("the run goes on with other options than it had, by --config: {}", other);
  // The end of a run by time is not that of a run which is given another length.
  const auto given = [&](const char* key) { return named.count(key) > 0 || given_on(app)(key); };
  if (given("iterations") && !given("end-iteration")) options.end_iteration = 0;
  validate(options);
}

void read_train_config(const std::filesystem::path& path, TrainOptions& options) {
  read_text(file_text(path), path, options, [](const std::string&) { return false; });
  validate(options);
}

TrainOptions parse_train_config(const std::string& text) {
  TrainOptions options;
  read_text(text, kCheckpointConfig, options, [](const std::string&) { return false; });
  return options;
}

std::string to_toml(const TrainOptions& options) {
  TrainOptions copy = options;
  std::string out;
  std::string section;
  for (const OptionRow& key : train_option_rows(copy)) {
    if (key.section != section) {
      section = key.section;
      out += fmt::format("{}# ---- {} ----\n", out.empty() ? "" : "\n", section);
    }
    out += fmt::format("{}{} = {}\n", comment(key.help), key.name, key.text());
  }
  return out;
}

// Trainers ask again once the photos have told the length; until then shares of a run and numbers
// of iterations cannot be compared.
void validate(const TrainOptions& options) {
  constexpr std::int64_t kSomeLength = 1000000;
  check_packet_width(options.trace);
  const auto& sizes = options.resolution_schedule;
  if (options.iterations < 0 && options.iterations != kFittedLength) {
    throw UsageError(fmt::format(
        "The option 'iterations' is a number from 0, or {} for what fits the photos, not {}",
        kFittedLength, options.iterations));
  }
  const bool told = options.iterations != kFittedLength;
  const std::int64_t length = told ? options.iterations : kSomeLength;
  const auto earlier = [told, length](const ResolutionStep& a, const ResolutionStep& b) {
    const bool comparable = told || (a.until.value < 1) == (b.until.value < 1);
    return comparable && a.until.of(length) < b.until.of(length);
  };
  if (!std::is_sorted(sizes.begin(), sizes.end(), earlier)) {
    throw UsageError("The iterations of 'resolution-schedule' have to ascend");
  }
  for (const LearningRate& rate : {options.sky_lr, options.pose_lr}) check_rate(rate);
  check_fitted("init-opacity", options.init_opacity, 1e-4);
  check_fitted("opacity-decay", options.opacity_decay, 0.0);
  for (const LearningRate& rate : {options.position_lr, options.scale_lr, options.sh_rest_lr})
    check_fitted_rate(rate);
  for (const LearningRate& rate : {options.rotation_lr, options.opacity_lr, options.sh_lr})
    check_fitted_end(rate);
  if (options.max_gaussians > 0 && options.init_count > options.max_gaussians) {
    throw UsageError(
        fmt::format("The start of 'init-count' = {} Gaussians is above 'max-gaussians' = {}: lower "
                    "the one or raise the other",
                    options.init_count, options.max_gaussians));
  }
  if (options.patience > 0 && options.validate_views == 0) {
    throw UsageError(
        "The option 'patience' counts validations, but there are none: set 'validate-views'");
  }
  const GradientSum sum = options.trace.gradient_sum;
  if (options.trace.deterministic && (sum == GradientSum::kAtomic || sum == GradientSum::kSwap)) {
    throw UsageError(fmt::format(
        "The options 'deterministic' and 'gradient-sum' = {} contradict each other, because such "
        "sums depend on the scheduling: use 'gradient-sum' = auto or leave 'deterministic' off",
        sum == GradientSum::kAtomic ? "atomic" : "swap"));
  }
  if (options.scale_max > 0 && options.scale_min > options.scale_max) {
    throw UsageError(
        fmt::format("The option 'scale-min' = {} is above 'scale-max' = {}: lower the one or raise "
                    "the other",
                    options.scale_min, options.scale_max));
  }
  if (options.poses && !options.mirrors.empty()) {
    throw UsageError(
        "The option 'poses' cannot be used with 'mirrors': behind a mirror the gradient of a pose "
        "is not known");
  }
  if (options.flat && options.scale_activation != ScaleActivation::kExp) {
    throw UsageError(
        "The option 'flat' needs 'scale-activation' = exp, whose numbers are the logarithms of "
        "sizes");
  }
  if (options.depth_weight > 0 && !options.mirrors.empty()) {
    throw UsageError(
        "The option 'depth-weight' cannot be used with 'mirrors': what is seen in them has no "
        "single depth");
  }
  if (options.leave_out_moving && !options.mirrors.empty()) {
    throw UsageError(
        "The option 'leave-out-moving' cannot be used with 'mirrors': what is seen in them has no "
        "place that other photos could tell of; leave one of them out");
  }
  if (options.background == "sky" && !options.mirrors.empty()) {
    throw UsageError(
        "The option 'background' = sky cannot be used with 'mirrors', which show one colour "
        "behind everything");
  }
  if (options.background == "sky" && options.poses) {
    throw UsageError(
        "The options 'background' = sky and 'poses' cannot be used together: the gradient of a "
        "pose is not known where there is a sky");
  }
  if (options.background != "random") background_color(options, false);
}

std::array<float, 3> background_color(const TrainOptions& options, bool cut_out) {
  const std::string& text = options.background;
  if (text == "auto" || text == "random" || text == "sky") {
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
    throw UsageError(fmt::format(
        "The option 'background' is auto, random, sky or three numbers from 0 to 1 such as "
        "1,1,1, not '{}'",
        text));
  }
  return color;
}

}  // namespace raysplats
