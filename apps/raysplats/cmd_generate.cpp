// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "options.hpp"
#include "synth/synthetic_dataset.hpp"
#include "validators.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::string directory;
  std::string scene = "still-life";
  bool overwrite = false;
  SyntheticOptions data;
};

constexpr std::array<std::pair<std::string_view, SyntheticScene>, 4> kScenes{
    {{"still-life", SyntheticScene::kStillLife},
     {"forward", SyntheticScene::kForward},
     {"room", SyntheticScene::kRoom},
     {"outdoor", SyntheticScene::kOutdoor}}};

void run(Options& options) {
  const auto* found = std::find_if(kScenes.begin(), kScenes.end(),
                                   [&](const auto& each) { return each.first == options.scene; });
  options.data.scene = found->second;
  generate_dataset(options.directory, options.data, options.overwrite);
  fmt::print("{} training and {} test views of {}x{} in {}\n", options.data.train_views,
             options.data.test_views, options.data.size, options.data.size, options.directory);
}

}  // namespace

Command add_generate_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("generate", "Write a small ray-traced data set (Blender or nerfstudio)");
  auto options = std::make_shared<Options>();
  SyntheticOptions& data = options->data;
  command->add_option("DIR,-o,--output", options->directory, "Folder for the data set")
      ->required()
      ->check(not_empty())
      ->type_name("");
  std::vector<std::string> names;
  names.reserve(kScenes.size());
  for (const auto& [name, scene] : kScenes) names.emplace_back(name);
  command
      ->add_option("--scene", options->scene,
                   "still-life (transparent ground), or before a wall (forward), in a room, or "
                   "outdoor with hills and sky")
      ->check(one_of(names))
      ->capture_default_str();
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
