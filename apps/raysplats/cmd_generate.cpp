// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <memory>

#include "options.hpp"
#include "synth/synthetic_dataset.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::string directory;
  bool overwrite = false;
  SyntheticOptions data;
};

void run(const Options& options) {
  generate_dataset(options.directory, options.data, options.overwrite);
  fmt::print("{} training and {} test views of {}x{} in {}\n", options.data.train_views,
             options.data.test_views, options.data.size, options.data.size, options.directory);
}

}  // namespace

Command add_generate_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("generate", "Write a small ray-traced data set (Blender format)");
  auto options = std::make_shared<Options>();
  SyntheticOptions& data = options->data;
  command->add_option("DIR,-o,--output", options->directory, "Folder for the data set")
      ->required()
      ->type_name("");
  command->add_option("--size", data.size, "Width and height of the images")
      ->transform(whole_between(8, 4096))
      ->capture_default_str();
  command->add_option("--train-views", data.train_views, "Images to train on")
      ->transform(whole_between(1, 10000))
      ->capture_default_str();
  command->add_option("--test-views", data.test_views, "Images held out")
      ->transform(whole_between(1, 10000))
      ->capture_default_str();
  command->add_option("--seed", data.seed, "Varies textures and cameras")
      ->transform(seed())
      ->capture_default_str();
  add_overwrite_flag(*command, options->overwrite);
  return {command, [options] { run(*options); }};
}

}  // namespace raysplats::cli
