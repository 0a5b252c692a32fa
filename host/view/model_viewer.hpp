// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <exception>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/context.hpp"
#include "raysplats/model.hpp"
#include "raysplats/trace_options.hpp"
#include "view/picture_source.hpp"
#include "view/viewer.hpp"

namespace raysplats::view {

/// Shows a model to pages from a thread of its own, which takes turns with whoever else uses the
/// context. The model may change meanwhile: pages that rest see it then. Context and model outlive
/// it.
class ModelViewer {
 public:
  /// Listens. `cameras` are the page's list, the first where it begins. The `state` of the options
  /// is set here. `origin` is the model's (Dataset::origin): camera paths of the page are in the
  /// coordinates of the data set's files, as `raysplats render --path` takes them. Throws as
  /// Viewer, UsageError for a model without Gaussians.
  ModelViewer(Context& context,
              const Model& model,
              const TraceOptions& trace,
              const std::vector<Camera>& cameras,
              const std::string& name,
              ViewerOptions options,
              const std::array<double, 3>& origin = {});
  ~ModelViewer();
  ModelViewer(const ModelViewer&) = delete;
  ModelViewer& operator=(const ModelViewer&) = delete;

  const std::string& url() const { return url_; }
  /// Ends thread and server; once is enough.
  void close();
  /// Whether it still serves. Throws what has ended it.
  bool serves() const;

 private:
  void work();

  Context& context_;
  const Model& model_;
  std::unique_ptr<PictureSource> pictures_;
  std::unique_ptr<Viewer> viewer_;
  std::string url_;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> failed_ = false;
  std::exception_ptr failure_;  // once failed_ says so
  std::thread thread_;
};

}  // namespace raysplats::view
