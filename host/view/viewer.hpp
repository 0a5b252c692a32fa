// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "view/dropped_meshes.hpp"
#include "view/picture_source.hpp"
#include "view/server.hpp"

namespace raysplats::view {

/// What users may choose as ViewerOptions::max_side.
constexpr int kLeastMaxSide = 64;
constexpr int kMostMaxSide = 8192;

struct ViewerOptions {
  ServerOptions server;
  int max_side = 1920;                 ///< pixels of pictures
  double moving_seconds = 1.0 / 15.0;  ///< for a picture while the camera moves
  std::string state;                   ///< JSON of /api/state, for the page to start with
  /// JSON of /api/run, asked for from another thread than that of work(). Without it there is no
  /// run.
  std::function<std::string()> run;
  /// The JPEG of /api/photo/N, asked for from that thread too; nothing for a number that there is
  /// not. Without it there are no photos.
  std::function<std::optional<std::string>(std::size_t number)> photo;
  /// Meshes that pages drop, used in the thread of work(), and outliving the viewer. Without
  /// it pages cannot drop any.
  DroppedMeshes* meshes = nullptr;
};

/// Shows a PictureSource to the pages that are open: takes what they want to see, the newest wish
/// of each, and draws in the thread that calls work(). While a camera moves pictures are as large
/// as `moving_seconds` allow; once it rests one picture of full size follows, then ever better ones
/// of more samples, until the camera moves again, which stops a picture of full size in the middle.
class Viewer {
 public:
  /// Listens; pages that open before work() wait. Throws as Server.
  explicit Viewer(const ViewerOptions& options);
  ~Viewer();

  /// As Server::urls().
  std::vector<std::string> urls() const;
  /// Pages that want to see something.
  std::size_t watchers() const;
  /// Whether a page that moves waits for its picture.
  bool awaited() const;
  /// Whether commands or questions wait for work().
  bool asked() const;
  /// Seconds since the last time that a page moved; infinite before.
  double seconds_since_motion() const;
  /// Hears of commands for a run, in the thread of work().
  void on_command(std::function<void(RunCommand)> handler);
  /// Text for every open page.
  void tell(const std::string& json);
  /// Tells every open page its last word, as tell() does, and waits up to a second until that is on
  /// its way.
  void tell_last(const std::string& json);

  /// Draws the next picture that a page waits for, or tells it why it cannot be drawn; `iteration`
  /// is that of the model. With nothing to do waits for up to `wait` seconds and returns false.
  /// `stop` is asked within pictures, whose drawing it ends.
  bool work(PictureSource& source,
            std::int64_t iteration,
            double wait,
            const std::function<bool()>& stop = {});
  /// The model has changed: pages that rest get new pictures.
  void refresh();
  /// From now on pages that rest get one sample, as large as it can be in that time: pictures of a
  /// model that changes. 0 ends that.
  void set_hurry(double seconds);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats::view
