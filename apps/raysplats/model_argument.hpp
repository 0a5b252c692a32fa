// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace raysplats::cli {

/// MODEL, of commands that show a model or, with `scenes`, a scene file as well.
inline void add_model_argument(CLI::App& command, std::string& model, bool scenes = false) {
  const std::string kinds = "Model (PLY, .splat, SPZ, SOG, glTF), ";
  command
      .add_option("MODEL", model,
                  kinds + (scenes ? "the folder of a training run, or a scene file (.toml)"
                                  : "or the folder of a training run"))
      ->required()
      ->type_name("");
}

}  // namespace raysplats::cli
