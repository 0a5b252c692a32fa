// SPDX-License-Identifier: Apache-2.0
#include "train/run_state.hpp"

#include <fmt/format.h>

#include <string>

#include "raysplats/error.hpp"
#include "raysplats/gaussians.hpp"

namespace raysplats {
namespace {

const char* activation_name(ScaleActivation activation) {
  return activation == ScaleActivation::kExp ? "exp" : "sigmoid";
}

const std::vector<float>& section(const Checkpoint& checkpoint,
                                  const std::string& name,
                                  std::size_t size) {
  const auto found = checkpoint.sections.find(name);
  if (found == checkpoint.sections.end() || found->second.size() != size) {
    throw DataError(fmt::format(
        "The checkpoint of iteration {} lacks {} numbers in '{}': resume from another one",
        checkpoint.iteration, size, name));
  }
  return found->second;
}

// {signal, number of views} per Gaussian, as checkpoints held before there was prune-weight, with
// nothing said of what their rays blend.
std::vector<float> with_weights(const std::vector<float>& older) {
  std::vector<float> out(older.size() / 2 * kDensityStatistics, 0.0f);
  for (std::size_t i = 0; 2 * i < older.size(); ++i) {
    out[kDensityStatistics * i] = older[2 * i];
    out[kDensityStatistics * i + 1] = older[2 * i + 1];
  }
  return out;
}

std::string mean_section(ParameterGroup group) { return std::string("mean.") + group_name(group); }

}  // namespace

CheckpointSections store_state(const DeviceGaussians& gaussians,
                               const Adam& adam,
                               const DensityControl& density,
                               Checkpoint& checkpoint) {
  checkpoint.count = gaussians.count;
  checkpoint.sh_degree = gaussians.sh_degree;
  checkpoint.active_sh_degree = gaussians.active_sh_degree;
  checkpoint.scale_activation = activation_name(gaussians.activation);
  checkpoint.optimiser_steps = adam.steps();
  CheckpointSections out;
  const auto add = [&out](const std::string& name, const Buffer<float>& numbers) {
    out[name] = [&numbers] {
      return numbers.size() > 0 ? numbers.download() : std::vector<float>();
    };
  };
  for (const ParameterGroup group : kParameterGroups) {
    const std::string name = group_name(group);
    add(name, gaussians[group]);
    out[name + ".first"] = [&adam, group] { return adam.first_moments(group); };
    out[name + ".second"] = [&adam, group] { return adam.second_moments(group); };
  }
  add("density", density.statistics());
  return out;
}

void restore_state(Context& context,
                   const Checkpoint& checkpoint,
                   const TrainOptions& options,
                   DeviceGaussians& gaussians,
                   Adam& adam,
                   DensityControl& density) {
  if (checkpoint.sh_degree != options.sh_degree ||
      checkpoint.scale_activation != activation_name(options.scale_activation)) {
    throw UsageError(
        fmt::format("The checkpoint has SH degree {} and scale activation {}, but the options say "
                    "{} and {}: resume with the "
                    "configuration of the run",
                    checkpoint.sh_degree, checkpoint.scale_activation, options.sh_degree,
                    activation_name(options.scale_activation)));
  }
  const std::size_t count = checkpoint.count;
  gaussians = DeviceGaussians();
  gaussians.count = count;
  gaussians.sh_degree = checkpoint.sh_degree;
  gaussians.active_sh_degree = checkpoint.active_sh_degree;
  gaussians.activation = options.scale_activation;
  gaussians.ensure(context, count, checkpoint.sh_degree, "parameters");
  adam.initialize(count, checkpoint.sh_degree);
  for (const ParameterGroup group : kParameterGroups) {
    const std::string name = group_name(group);
    const std::size_t size = count * group_width(group, checkpoint.sh_degree);
    gaussians[group].upload(section(checkpoint, name, size));
    adam.restore(group, section(checkpoint, name + ".first", size),
                 section(checkpoint, name + ".second", size));
  }
  gaussians.changed(context);
  adam.set_steps(checkpoint.optimiser_steps);
  const auto statistics = checkpoint.sections.find("density");
  if (statistics == checkpoint.sections.end() || statistics->second.empty())
    density.restore_statistics({});
  else if (statistics->second.size() == 2 * count)
    density.restore_statistics(with_weights(statistics->second));
  else
    density.restore_statistics(section(checkpoint, "density", kDensityStatistics * count));
}

CheckpointSections store_mean(const ParameterMean& mean, Checkpoint& checkpoint) {
  CheckpointSections out;
  checkpoint.mean_since = mean.since();
  if (!mean.known()) return out;
  for (const ParameterGroup group : kParameterGroups)
    out[mean_section(group)] = [&mean, group] { return mean.model()[group].download(); };
  return out;
}

void restore_mean(const Checkpoint& checkpoint,
                  const TrainOptions& options,
                  const DeviceGaussians& gaussians,
                  ParameterMean& mean) {
  const bool stored = checkpoint.sections.count(mean_section(ParameterGroup::kMeans)) > 0;
  if (!stored) return mean.restart(checkpoint.mean_since);
  if (!mean.restore(options, gaussians, checkpoint.iteration, checkpoint.mean_since)) return;
  for (const ParameterGroup group : kParameterGroups) {
    const std::size_t size = gaussians.count * group_width(group, gaussians.sh_degree);
    mean.model()[group].upload(section(checkpoint, mean_section(group), size));
  }
}

}  // namespace raysplats
