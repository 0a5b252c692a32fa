// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <set>
#include <string>

#include "raysplats/train_options.hpp"

namespace CLI {
class App;
}

namespace raysplats {

/// Registers every key of TrainOptions as an option of `app` (a subcommand), and `--config FILE`, a
/// TOML file of flat keys (a [train] table is allowed). Values of the file count where the command
/// line says nothing. `options` has to outlive the app's parse. Parsing throws UsageError for
/// values and files that are wrong; for an unknown key it names the nearest known one. Where the
/// app's --resume is given, file and combinations wait for apply_resumed_options().
void add_train_options(CLI::App& app, TrainOptions& options);

/// Completes the options of such an app, parsed before: those of the run that is resumed, from its
/// config.toml, or without one from the checkpoint; above them the keys of --config, above these
/// the command line. `source` is a run folder or a checkpoint file. What a run of an older version
/// could not name keeps the value that it had then. Keys in `chosen` are the run's, whatever
/// --config says of them: what it chose in their place is not to be chosen anew. Of keys in `anew`
/// the run says nothing, because they are. Throws UsageError as parsing does, DataError for a
/// damaged checkpoint.
void apply_resumed_options(CLI::App& app,
                           TrainOptions& options,
                           const std::filesystem::path& source,
                           const std::set<std::string>& chosen = {},
                           const std::set<std::string>& anew = {});

/// Reads a configuration file into `options`.
void read_train_config(const std::filesystem::path& path, TrainOptions& options);

/// Reads the text of a configuration that a run wrote (to_toml(), in a checkpoint).
TrainOptions parse_train_config(const std::string& text);

/// The options as a configuration file with every key and what it means.
std::string to_toml(const TrainOptions& options);

/// Throws UsageError for combinations that cannot be trained.
void validate(const TrainOptions& options);

/// The constant colour behind the Gaussians in evaluations, and in training unless it is "random";
/// `cut_out` says that the photos are composited by their alpha. "auto" is white behind those and
/// else black: a run names the mean colour that it chose in its configuration. Throws UsageError
/// for a text that is no colour.
std::array<float, 3> background_color(const TrainOptions& options, bool cut_out);

}  // namespace raysplats
