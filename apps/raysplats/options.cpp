// SPDX-License-Identifier: Apache-2.0
#include "options.hpp"

#include <fmt/format.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>
#include <system_error>
#include <utility>

#include "run/train_keys.hpp"
#include "scene/camera_check.hpp"
#include "scene/option_flags.hpp"
#include "util/nearest_name.hpp"
#include "util/number_text.hpp"
#include "util/progress.hpp"

namespace raysplats::cli {
namespace {

/// Refuses what is not `wanted`, and writes what is so that CLI11 reads the same.
CLI::Validator number_check(const std::string& wanted, const std::function<bool(double)>& valid) {
  return CLI::Validator(
      [=](std::string& text) {
        const std::optional<double> value = parse_real(text);
        if (!value || !valid(*value)) return fmt::format("{} is not {}", text, wanted);
        text = fmt::format("{}", *value);
        return std::string();
      },
      "");
}

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(command->get_name());
  }
  return names;
}

}  // namespace

void add_global_options(CLI::App& app, GlobalOptions& options) {
  app.add_option("--log-level", options.log_level,
                 "Least severe log lines to show: debug, info, warn, error, off")
      ->check(one_of({"debug", "info", "warn", "error", "off"}))
      ->capture_default_str()
      ->type_name("LEVEL");
  app.add_flag("-q,--quiet", options.quiet, "Show errors only: no log lines, no progress");
}

namespace {

thread_local bool silent_thread = false;

class LogSink : public spdlog::sinks::stderr_color_sink_mt {
 public:
  void log(const spdlog::details::log_msg& message) override {
    if (!silent_thread || message.level >= spdlog::level::err)
      spdlog::sinks::stderr_color_sink_mt::log(message);
  }
};

}  // namespace

LogSilence::LogSilence(bool silent) : before_(std::exchange(silent_thread, silent)) {}
LogSilence::~LogSilence() { silent_thread = before_; }

void start_logging(const GlobalOptions& options) {
  auto logger = std::make_shared<spdlog::logger>("raysplats", std::make_shared<LogSink>());
  logger->set_pattern("[%H:%M:%S] %^%l%$: %v");
  logger->set_level(options.quiet ? spdlog::level::err
                                  : spdlog::level::from_str(options.log_level));
  spdlog::set_default_logger(logger);
}

void add_device_flags(CLI::App& app, DeviceFlags& flags) {
  app.add_option("--device", flags.device,
                 "Index or part of the name of a device ('raysplats devices' lists them); train, "
                 "render and eval share their work among several, as in 0,1")
      ->type_name("DEVICE");
  app.add_flag("--profile", flags.profile, "Print the device time per kernel");
  app.add_flag("--no-kernel-cache", flags.no_kernel_cache, "Compile every kernel again");
}

namespace {

// Shows the compiling of kernels, whose number nobody knows before: a bar without an end.
std::function<void(std::size_t, const std::string&)> show_compiling() {
  if (silent_thread || !spdlog::should_log(spdlog::level::info)) return {};
  const auto bar = std::make_shared<Progress>("compiling kernels", Progress::kUnknown);
  return [bar](std::size_t number, const std::string& program) {
    if (program.empty()) {
      bar->suspend();
      return;
    }
    bar->resume();
    bar->update(static_cast<std::int64_t>(number), program);
  };
}

// Empty where the system does not tell.
std::filesystem::path own_program() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error);
}

}  // namespace

std::unique_ptr<Context> open_context(const DeviceFlags& flags) {
  return open_context(flags, select_device(flags.device));
}

std::unique_ptr<Context> open_context(const DeviceFlags& flags, const DeviceInfo& device) {
  ContextOptions options;
  options.compiling = show_compiling();
  options.compiler = own_program();
  options.profile = flags.profile;
  options.kernel_cache = !flags.no_kernel_cache;
  spdlog::info("device {}: {} ({})", device.index, device.name, device.platform);
  return std::make_unique<Context>(device, options);
}

namespace {

// An option by its row of the table, kept for what it goes over.
template <class Options, std::vector<OptionRow> (*rows_of)(Options&)>
CLI::Option* add_setting(CLI::App& app,
                         GivenOptions<Options, rows_of>& settings,
                         const std::string& name,
                         const std::string& names = {}) {
  Options defaults;
  const std::vector<OptionRow> rows = rows_of(defaults);
  return add_row(
      app, *find_row(rows, name),
      [&settings, name](const std::vector<std::string>& values) { settings.set(name, values); },
      names);
}

}  // namespace

void add_trace_flags(CLI::App& app, TraceSettings& settings) {
  add_setting(app, settings, "quantile", "--q");
  for (const char* name : {"min-transmittance", "max-hits", "hit-order", "adaptive-radius", "near"})
    add_setting(app, settings, name);
  add_setting(app, settings, "background")->type_name("R,G,B");
  for (const char* name : {"packet-shape", "packet-width", "memory-budget", "launch-budget-ms"})
    add_setting(app, settings, name);
}

void add_traversal_flag(CLI::App& app, TraceSettings& settings) {
  add_setting(app, settings, "traversal");
}

void add_render_flags(CLI::App& app, GivenRenderSettings& settings, const std::string& group) {
  for (const char* name : {"samples", "max-bounces", "seed"})
    add_setting(app, settings, name)->group(group);
}

std::string with_compiling(const std::string& text, double seconds) {
  if (seconds < 0.1) return text;
  return fmt::format("{}, besides {:.1f} s of compiling kernels", text, seconds);
}

void warn_of_capped_rays(std::uint64_t capped, std::uint64_t rays, const TraceOptions& options) {
  if (capped == 0) return;
  spdlog::warn("{} of {} rays stopped at --max-hits {}: raise it for the rest of their colour",
               capped, rays, options.max_hits);
}

CLI::Option* add_data_flags(CLI::App& app, DataFlags& flags, const std::string& split) {
  const std::string group = "Data set";
  CLI::Option* data = app.add_option("-d,--data", flags.data,
                                     "Data set (as of train) whose cameras to use; what is not "
                                     "said of it is as in the run of the model, else the default");
  data->group(group)->type_name("DATASET");
  app.add_option("--split", flags.split, split)
      ->group(group)
      ->check(one_of({"test", "train", "all"}));
  for (const char* name : {"downscale", "test-every", "undistort", "masks", "alpha"})
    add_setting(app, flags.settings, name)->group(group);
  return data;
}

Split DataFlags::chosen_split() const {
  const std::string name = split.value_or("test");
  if (name == "train") return Split::kTrain;
  return name == "all" ? Split::kAll : Split::kTest;
}

void DataFlags::check_used(bool orbit) const {
  const bool chosen = split || settings.has("test-every");
  if (data.empty() &&
      (chosen || settings.has("undistort") || settings.has("masks") || settings.has("alpha"))) {
    throw UsageError(
        "--split, --test-every, --undistort, --masks and --alpha are about the views of a data "
        "set: add --data DATASET");
  }
  if (orbit && chosen) {
    throw UsageError(
        "--split and --test-every choose views, but an orbit goes around all of them: leave them "
        "out");
  }
  if (orbit && data.empty() && settings.has("downscale")) {
    throw UsageError(
        "--downscale divides the sizes of photos, and this orbit has none: give --width and "
        "--height");
  }
}

void add_overwrite_flag(CLI::App& app, bool& flag) {
  app.add_flag("--overwrite", flag, "Also into a folder that holds results of something else");
}

std::vector<Camera> cameras_of(const Dataset& dataset, Split split) {
  std::vector<Camera> cameras;
  for (const std::size_t i : dataset.indices(split)) cameras.push_back(dataset.views[i].camera);
  return cameras;
}

DataError no_views(const DataFlags& flags) {
  return DataError(fmt::format("The {} split of {} has no views: choose another --split",
                               flags.split.value_or("test"), flags.data));
}

CLI::Validator at_least(double low) { return between(low, kNoBound); }

CLI::Validator above(double low) {
  return number_check(fmt::format("a number above {}", low), [low](double v) { return v > low; });
}

CLI::Validator between(double low, double high) {
  return number_check(number_words(false, low, high),
                      [=](double v) { return v >= low && v <= high; });
}

CLI::Validator whole_between(double low, double high) {
  return CLI::Validator(
      [=](std::string& text) {
        const std::optional<std::int64_t> value = parse_whole(text);
        const auto number = static_cast<double>(value.value_or(0));
        if (!value || number < low || number > high) {
          return fmt::format("{} is not {}", text, number_words(true, low, high));
        }
        text = std::to_string(*value);
        return std::string();
      },
      "");
}

CLI::Validator seed() {
  return CLI::Validator(
      [](std::string& text) {
        const std::optional<std::uint64_t> value = parse_natural(text);
        if (!value) {
          return fmt::format("{} is not a whole number from 0 to 18446744073709551615", text);
        }
        text = std::to_string(*value);
        return std::string();
      },
      "");
}

CLI::Validator one_of(std::vector<std::string> names) {
  const std::string name = fmt::format("{}", fmt::join(names, "|"));
  return CLI::Validator(
      [names = std::move(names)](const std::string& text) {
        if (std::find(names.begin(), names.end(), text) != names.end()) return std::string();
        return fmt::format("'{}' is none of {}", text, fmt::join(names, ", "));
      },
      "", name);
}

namespace {

/// That many numbers with commas; `said` is how the sentence that refuses others puts it.
CLI::Validator numbers(std::size_t count, const char* said) {
  return CLI::Validator(
      [count, said](const std::string& text) {
        const std::optional<std::vector<std::string>> parts = list_items({text});
        const bool good = parts && parts->size() == count &&
                          std::all_of(parts->begin(), parts->end(), [](const std::string& part) {
                            return parse_real(part).has_value();
                          });
        return good ? std::string() : fmt::format("'{}' is not {}", text, said);
      },
      "");
}

template <std::size_t kCount>
std::array<double, kCount> parse_numbers(const std::string& text) {
  const std::vector<std::string> parts = list_items({text}).value_or(std::vector<std::string>());
  std::array<double, kCount> out{};
  for (std::size_t k = 0; k < kCount; ++k) out[k] = parse_real(parts.at(k)).value_or(0.0);
  return out;
}

}  // namespace

CLI::Validator triple() { return numbers(3, "three numbers with commas, as in 1,0.5,0"); }

std::array<double, 3> parse_triple(const std::string& text) { return parse_numbers<3>(text); }

CLI::Validator box() {
  return numbers(6, "least and greatest x, y, z with commas, as in -1,-1,0,1,1,2");
}

std::array<double, 6> parse_box(const std::string& text) { return parse_numbers<6>(text); }

namespace {

/// Whether an option takes a list of numbers, which shells cut into words at its spaces.
bool takes_numbers(std::string_view name) {
  if (name == "--background" || name == "--up" || name == "--sizes" || name == "--crop")
    return true;
  TrainOptions options;
  const std::vector<OptionRow> keys = train_keys(options);
  return name.starts_with("--") && std::any_of(keys.begin(), keys.end(), [&](const OptionRow& key) {
           return key.list == OptionRow::List::kNumbers && key.name == name.substr(2);
         });
}

}  // namespace

std::string shell_quoted(std::string_view text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

std::string command_line(int argc, const char* const* argv) {
  std::string line = "raysplats";
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    const bool plain = !word.empty() && std::all_of(word.begin(), word.end(), [](unsigned char c) {
      return std::isalnum(c) != 0 ||
             std::string_view("-_=./:,+@%").find(static_cast<char>(c)) != std::string_view::npos;
    });
    line += fmt::format(" {}", plain ? std::string(word) : shell_quoted(word));
  }
  return line;
}

std::vector<std::string> own_arguments(int argc, const char* const* argv) {
  // gsplat's and OpenSplat's names for what every trainer needs.
  constexpr std::array<std::pair<std::string_view, std::string_view>, 5> kForeign{
      {{"--data_dir", "--data"},
       {"--result_dir", "--output"},
       {"--max_steps", "--iterations"},
       {"--num-iters", "--iterations"},
       {"--data_factor", "--downscale"}}};
  std::vector<std::string> arguments;
  for (int i = 1; i < argc; ++i) {
    std::string word = argv[i];
    const std::string_view name = std::string_view(word).substr(0, word.find('='));
    for (const auto& [foreign, own] : kForeign) {
      if (name != foreign) continue;
      word.replace(0, foreign.size(), own);
      break;
    }
    // One word for a list, so that what follows it is no part of it: --save-at 5 10 DATA.
    const std::size_t mark = word.find('=');
    if (takes_numbers(std::string_view(word).substr(0, mark))) {
      for (; i + 1 < argc && is_number_list_part(argv[i + 1]); ++i) {
        word += word.find('=') == std::string::npos ? '=' : ' ';
        word += argv[i + 1];
      }
    }
    arguments.push_back(std::move(word));
  }
  return arguments;
}

std::string explain(const CLI::ParseError& error, const CLI::App& app) {
  const std::vector<CLI::App*> parsed = app.get_subcommands();
  const CLI::App& command = parsed.empty() ? app : *parsed.front();
  const std::string help =
      parsed.empty() ? "raysplats -h" : fmt::format("raysplats {} -h", command.get_name());
  // What was left over explains more than what is missing because of it.
  for (const std::string& text : app.remaining(true)) {
    if (text.size() > 1 && text.front() == '-') {
      const std::string name = text.substr(0, text.find('='));
      std::vector<std::string> known = option_names(command);
      for (std::string& global : option_names(app)) known.push_back(std::move(global));
      return fmt::format("Unknown option {}: did you mean {}? '{}' lists all", name,
                         nearest_name(name, known), help);
    }
    if (parsed.empty()) {
      return fmt::format("Unknown command '{}': did you mean '{}'? '{}' lists all", text,
                         nearest_name(text, command_names(app)), help);
    }
    return fmt::format("Unexpected argument '{}': '{}' shows what {} takes", text, help,
                       command.get_name());
  }
  if (parsed.empty() && error.get_name() == "RequiredError") {
    return fmt::format("No command given: use one of {}; 'raysplats -h' explains them",
                       fmt::join(command_names(app), ", "));
  }
  return fmt::format("{} ('{}' explains the options)", error.what(), help);
}

std::vector<std::string> parts_of(const std::string& text) {
  std::optional<std::vector<std::string>> parts = list_items({text});
  if (!parts) throw UsageError(fmt::format("'{}' is no list as in a,b", text));
  return std::move(*parts);
}

std::vector<std::string> names_of(const std::string& option,
                                  const std::string& text,
                                  const std::vector<std::string>& known) {
  std::vector<std::string> names = parts_of(text);
  for (const std::string& name : names) {
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      throw UsageError(fmt::format("{} '{}' is none of {}", option, name, fmt::join(known, ", ")));
    }
  }
  if (names.empty()) {
    throw UsageError(fmt::format("{} names nothing: choose of {}", option, fmt::join(known, ", ")));
  }
  return names;
}

std::size_t parse_count(const std::string& option, const std::string& text) {
  double factor = 1;
  std::string digits = text;
  if (!digits.empty() && (digits.back() == 'k' || digits.back() == 'M')) {
    factor = digits.back() == 'k' ? 1e3 : 1e6;
    digits.pop_back();
  }
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size() || !(value * factor >= 1) ||
      value * factor > 1e9) {
    throw UsageError(
        fmt::format("{} '{}' is no number of Gaussians, as in 10000, 100k or 1M", option, text));
  }
  return static_cast<std::size_t>(value * factor);
}

double parse_duration(const std::string& option, const std::string& text) {
  double unit = 1;
  std::string digits = text;
  if (!digits.empty() && std::string_view("smh").find(digits.back()) != std::string_view::npos) {
    unit = digits.back() == 'h' ? 3600 : digits.back() == 'm' ? 60 : 1;
    digits.pop_back();
  }
  const std::optional<double> value = parse_real(digits);
  if (!value || !(*value * unit > 0) || *value * unit > 1e9) {
    throw UsageError(
        fmt::format("{} '{}' is no time to train in, as in 90s, 15m or 1.5h", option, text));
  }
  return *value * unit;
}

std::pair<int, int> parse_resolution(const std::string& text) {
  int width = 0, height = 0;
  const char* end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, width);
  if (first.ec == std::errc() && first.ptr != end && *first.ptr == 'x') {
    const auto second = std::from_chars(first.ptr + 1, end, height);
    if (second.ec == std::errc() && second.ptr == end && width > 0 && height > 0 &&
        width <= kMaxSide && height <= kMaxSide) {
      return {width, height};
    }
  }
  throw UsageError(fmt::format("--resolution '{}' is not WIDTHxHEIGHT, as in 800x800", text));
}

std::string describe(const DeviceTuning& tuning) {
  const std::string group = tuning.group == 0 ? "whole tiles" : std::to_string(tuning.group);
  return fmt::format("packet width {}{}, tiles of {}, pending {}, groups of {}{}",
                     tuning.packet_width,
                     tuning.subgroups ? " as subgroups"
                     : tuning.grouped ? " as work-groups"
                                      : "",
                     tuning.tile, tuning.pending, group, tuning.bvh ? ", bvh" : "");
}

std::string readable_bytes(std::uint64_t bytes) {
  constexpr std::array<const char*, 5> kUnits{"B", "KiB", "MiB", "GiB", "TiB"};
  auto value = static_cast<double>(bytes);
  std::size_t unit = 0;
  for (; value >= 1024.0 && unit + 1 < kUnits.size(); ++unit) value /= 1024.0;
  return fmt::format("{:.{}f} {}", value, unit == 0 ? 0 : 1, kUnits[unit]);
}

}  // namespace raysplats::cli
