// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <nlohmann/json.hpp>

#include "raysplats/io.hpp"
#include "train/step_options.hpp"
#include "train/trainer_impl.hpp"
#include "util/atomic_file.hpp"
#include "util/json_text.hpp"

namespace raysplats {

// Stops the run when the guard has stopped the steps; waits for the device.
StepGuard::Counts Trainer::Impl::check_guard() {
  const StepGuard::Counts counts = guard.counts();
  if (counts.stopped) {
    if (ranks.leads()) write_dump();
    ranks.barrier();
    throw Error(
        ErrorCode::kRuntime,
        fmt::format("The loss or the gradients were not finite in {} steps in a row by iteration "
                    "{}; the model before them, the last picture and its camera are in {}: lower "
                    "the learning rates, or look for photos and points that are not finite",
                    StepGuard::kLimit, iteration, (run.path() / "dump").string()));
  }
  if (counts.bad_steps > reported_bad_steps) {
    spdlog::warn("iteration {}: {} steps so far had a loss or gradients that were not finite",
                 iteration, counts.bad_steps);
    reported_bad_steps = counts.bad_steps;
  }
  return counts;
}

// Stops the run at a fault that no step may leave behind.
void Trainer::Impl::validate_model() {
  if (!validator) {
    validator.emplace(context, trace_options_of(options, background));
  }
  const std::string fault = validator->find_fault(gaussians, adam, tracer.ray_tracer());
  if (fault.empty()) return;
  throw Error(ErrorCode::kRuntime,
              fmt::format("The model is damaged after iteration {}: {}; resume from an earlier "
                          "checkpoint, with --validate-every 1 to find the step, or on another "
                          "--device",
                          iteration, fault));
}

// What somebody who looks for the cause needs.
void Trainer::Impl::write_dump() {
  const std::filesystem::path folder = run.path() / "dump";
  write_image(folder / "picture.exr", tracer.download_image(), {}, ColorSpace::kDisplay);
  const Camera& camera = train_cameras[slots[share.last - 1].view];  // of the picture
  nlohmann::json rotation = nlohmann::json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rotation.push_back(camera.rotation[column][row]);
  }
  const nlohmann::json json{
      {"iteration", iteration},
      {"loss", loss.value().total},
      {"view", camera.name},
      {"width", camera.width},
      {"height", camera.height},
      {"world_to_camera", rotation},
      {"translation", {camera.translation[0], camera.translation[1], camera.translation[2]}},
      {"refused_gradients", skipped_before + adam.skipped()}};
  write_text_file(folder / "step.json", json_text(json, 2) + "\n");
  write_state(folder / "state.rsck");
}

}  // namespace raysplats
