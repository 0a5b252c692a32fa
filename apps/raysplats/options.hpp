// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "comm/communicator.hpp"
#include "device/context.hpp"
#include "io/data_rows.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "raysplats/trace_options.hpp"
#include "scene/render_rows.hpp"
#include "scene/trace_rows.hpp"

namespace raysplats::cli {

/// Options that stand before or after any command.
struct GlobalOptions {
  std::string log_level = "info";
  bool quiet = false;
  /// The processes that mpirun has started, of which this is one; alone as a rule.
  mutable Communicator processes = {};
  std::string command;  ///< the line that started the program
};
void add_global_options(CLI::App& app, GlobalOptions& options);
/// Log lines go to standard error, so that results on standard output can be piped.
void start_logging(const GlobalOptions& options);
/// While one with `silent` lives, its thread logs errors only: another thread says the same.
class LogSilence {
 public:
  explicit LogSilence(bool silent);
  ~LogSilence();
  LogSilence(const LogSilence&) = delete;
  LogSilence& operator=(const LogSilence&) = delete;

 private:
  bool before_;
};

/// A command of the program; `run` is called after everything has been parsed.
struct Command {
  CLI::App* app = nullptr;
  std::function<void()> run;
};
Command add_devices_command(CLI::App& app);
Command add_doctor_command(CLI::App& app);
Command add_generate_command(CLI::App& app);
Command add_prepare_command(CLI::App& app, const GlobalOptions& global);
Command add_train_command(CLI::App& app, const GlobalOptions& global);
Command add_render_command(CLI::App& app, const GlobalOptions& global);
Command add_eval_command(CLI::App& app, const GlobalOptions& global);
Command add_trace_command(CLI::App& app);
Command add_info_command(CLI::App& app);
Command add_convert_command(CLI::App& app);
Command add_view_command(CLI::App& app);
Command add_report_command(CLI::App& app);
Command add_bench_command(CLI::App& app);
Command add_tune_command(CLI::App& app);
Command add_completion_command(CLI::App& app);
Command add_manual_command(CLI::App& app);
Command add_compile_kernels_command(CLI::App& app);

struct DeviceFlags {
  std::string device;
  bool profile = false;
  bool no_kernel_cache = false;
};
void add_device_flags(CLI::App& app, DeviceFlags& flags);
/// On the device that the flags name, or on this one.
std::unique_ptr<Context> open_context(const DeviceFlags& flags);
std::unique_ptr<Context> open_context(const DeviceFlags& flags, const DeviceInfo& device);

/// Tracing options as given: what is not given stays as the model's run or the defaults have it.
void add_trace_flags(CLI::App& app, TraceSettings& settings);
/// --traversal, for commands that trace cameras by either way.
void add_traversal_flag(CLI::App& app, TraceSettings& settings);

/// Of scene files, under a heading: --samples, --max-bounces and --seed.
void add_render_flags(CLI::App& app, GivenRenderSettings& settings, const std::string& group);

/// `text`, and how long kernels were compiled where that is worth mentioning.
std::string with_compiling(const std::string& text, double seconds);

/// One warning line when rays stopped at the cap on hits.
void warn_of_capped_rays(std::uint64_t capped, std::uint64_t rays, const TraceOptions& options);

/// A data set and which of its views to use at which size; what is not given is as in the model's
/// run.
struct DataFlags {
  std::string data;
  std::optional<std::string> split;  ///< "test" when not given
  DataSettings settings;

  Split chosen_split() const;
  /// Throws UsageError for options that choose among views where no data set gives any, or where
  /// an orbit goes around all of them.
  void check_used(bool orbit) const;
};
/// Returns the option --data. `split` is the help of --split, with what is taken where it is not
/// given.
CLI::Option* add_data_flags(CLI::App& app,
                            DataFlags& flags,
                            const std::string& split = "test (default), train or all");
DataError no_views(const DataFlags& flags);
std::vector<Camera> cameras_of(const Dataset& dataset, Split split);

/// --overwrite: outputs may take the place of what is there.
void add_overwrite_flag(CLI::App& app, bool& flag);

/// Validators whose messages are one sentence.
CLI::Validator at_least(double low);
CLI::Validator above(double low);
CLI::Validator between(double low, double high);
/// Whole numbers, in every spelling that configuration files know (1_000, 1e3).
CLI::Validator whole_between(double low, double high);
/// 0 to 2^64 - 1.
CLI::Validator seed();
/// Its name is the words with '|' between them (command_tree()).
CLI::Validator one_of(std::vector<std::string> names);
/// Three numbers with commas, for example a colour or a direction.
CLI::Validator triple();
std::array<double, 3> parse_triple(const std::string& text);

/// Accepts the six numbers of a box, as --bounds has them, and reads what it has accepted.
CLI::Validator box();
std::array<double, 6> parse_box(const std::string& text);

/// In single quotes, within which a shell takes everything as it is but these.
std::string shell_quoted(std::string_view text);
/// The program and its arguments as a shell takes them.
std::string command_line(int argc, const char* const* argv);
/// The arguments without the program's name; names that other trainers use for the same become
/// ours.
std::vector<std::string> own_arguments(int argc, const char* const* argv);

/// One sentence for a command line that does not parse, with the nearest known command or option.
std::string explain(const CLI::ParseError& error, const CLI::App& app);

/// The items of a list in any spelling (list_items()). Throws UsageError when it is none.
std::vector<std::string> parts_of(const std::string& text);
/// The same, each of which must be one of `known`; UsageError for others and for none.
std::vector<std::string> names_of(const std::string& option,
                                  const std::string& text,
                                  const std::vector<std::string>& known);
/// A number of Gaussians: "100k", "1.5M" or plain digits.
std::size_t parse_count(const std::string& option, const std::string& text);
/// Seconds of a duration: "90", "90s", "1.5m" or "2h".
double parse_duration(const std::string& option, const std::string& text);
/// Width and height of "800x600".
std::pair<int, int> parse_resolution(const std::string& text);

/// "packet width 16, tiles of 32, pending 96, groups of whole tiles".
std::string describe(const DeviceTuning& tuning);

/// "1.5 GiB" and the like.
std::string readable_bytes(std::uint64_t bytes);

}  // namespace raysplats::cli
