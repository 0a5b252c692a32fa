// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "validators.hpp"
#include "view/viewer.hpp"

namespace raysplats::cli {

/// Where the viewer listens unless it is told otherwise.
inline view::ViewerOptions view_options() {
  view::ViewerOptions options;
  options.server.port = 7377;
  return options;
}

/// --host, --port and --max-size, as they are added.
inline std::vector<CLI::Option*> add_viewer_flags(CLI::App& command, view::ViewerOptions& viewer) {
  return {
      command
          .add_option("--host", viewer.server.host,
                      "Address to listen on, 0.0.0.0 or :: for all of this machine; other machines "
                      "can reach any but 127.0.0.1, and whoever has the printed address may look")
          ->type_name("ADDRESS")
          ->capture_default_str(),
      command.add_option("--port", viewer.server.port, "Port to listen on; 0 = any that is free")
          ->transform(whole_between(0, 65535))
          ->capture_default_str(),
      command.add_option("--max-size", viewer.max_side, "Largest side of the pictures in pixels")
          ->transform(whole_between(view::kLeastMaxSide, view::kMostMaxSide))
          ->capture_default_str()};
}

}  // namespace raysplats::cli
