// SPDX-License-Identifier: Apache-2.0
#include "view/model_viewer.hpp"

#include <fmt/format.h>

#include <optional>

#include "raysplats/error.hpp"
#include "scene/camera/orbit.hpp"
#include "view/view_state.hpp"

namespace raysplats::view {

ModelViewer::ModelViewer(Context& context,
                         const Model& model,
                         const TraceOptions& trace,
                         const std::vector<Camera>& cameras,
                         const std::string& name,
                         ViewerOptions options,
                         const std::array<double, 3>& origin)
    : context_(context), model_(model), pictures_(model_pictures(context, model, trace, {})) {
  if (model.size() == 0) throw UsageError("A model without Gaussians cannot be looked at");
  ViewState state = first_look(scene_extent(model.download()), cameras, std::nullopt);
  state.name = name;
  state.origin = {origin[0], origin[1], origin[2]};
  state.about = fmt::format("{} Gaussians, SH degree {}", model.size(), model.sh_degree());
  state.has_near = state.has_depth = state.has_order = true;
  state.near_depth = trace.near_depth;
  options.state = state_json(state);
  viewer_ = std::make_unique<Viewer>(options);
  url_ = viewer_->urls().front();
  thread_ = std::thread([this] { work(); });
}

ModelViewer::~ModelViewer() { close(); }

void ModelViewer::close() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
  viewer_.reset();
}

bool ModelViewer::serves() const {
  if (failed_) std::rethrow_exception(failure_);
  return !stopping_;
}

void ModelViewer::work() {
  constexpr double kWait = 0.1;  // seconds within which a change is seen
  const auto revision = [this] {
    const auto turn = context_.lock();
    return model_.revision();
  };
  try {
    std::uint64_t shown = revision();
    while (!stopping_) {
      if (const std::uint64_t now = revision(); now != shown) {
        shown = now;
        viewer_->refresh();
      }
      viewer_->work(*pictures_, 0, kWait, [this] { return stopping_.load(); });
    }
  } catch (...) {
    failure_ = std::current_exception();
    failed_ = true;
  }
}

}  // namespace raysplats::view
