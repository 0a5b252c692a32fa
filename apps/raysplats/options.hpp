// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "comm/communicator.hpp"
#include "device/context.hpp"
#include "io/dataset/data_option_table.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "raysplats/trace_options.hpp"
#include "scene/options/render_option_table.hpp"
#include "scene/options/trace_option_table.hpp"

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

/// Options of scene files, under a heading: --samples, --max-bounces and --seed.
void add_render_flags(CLI::App& app, GivenRenderSettings& settings, const std::string& group);

/// `text`, and how long kernels were compiled where that is worth mentioning.
std::string with_compiling(const std::string& text, double seconds);

/// One warning line when rays stopped at the cap on hits.
void warn_of_capped_rays(std::uint64_t capped, std::uint64_t rays, const TraceOptions& options);
/// One line when paths ended at their last surface: a warning where they may be seen, at more than
/// one of a hundred of the camera's rays.
void tell_of_ended_paths(std::uint64_t ended, std::uint64_t camera_rays, int max_bounces);

/// A data set and which of its views to use at which size; what is not given is as in the model's
/// run.
struct DataFlags {
  std::string data;
  std::optional<std::string> split;  ///< "test" when not given
  DataSettings settings;

  Split chosen_split() const;
  /// How to read the data set, of which `run` says what the command line does not. Where `all`
  /// views are taken, the run's list of test photos chooses none, and other data need not have
  /// them.
  DatasetOptions over(DatasetOptions run, bool all) const;
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
/// Which photos are held out, and what of them counts, for commands that say what a data set is.
inline constexpr std::array kPhotoFlags{"test-every", "test-list", "borders", "ignore-areas"};
void add_photo_flags(CLI::App& app, DataSettings& settings);

/// --overwrite: outputs may take the place of what is there. `help` says of what.
void add_overwrite_flag(
    CLI::App& app,
    bool& flag,
    const std::string& help = "Also into a folder that holds results of something else");
/// The same for results that are files.
inline constexpr const char* kOverwriteFile = "Take the place of a file that is there already";

}  // namespace raysplats::cli
