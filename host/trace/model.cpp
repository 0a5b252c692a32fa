// SPDX-License-Identifier: Apache-2.0
#include "raysplats/model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "raysplats/error.hpp"
#include "trace/model_impl.hpp"

namespace raysplats {
namespace {

void check_array(const char* name, const std::vector<float>& values, std::size_t expected) {
  if (values.size() != expected) {
    throw UsageError(fmt::format(
        "The Gaussians have {} numbers of {} where {} are needed: give every array its size",
        values.size(), name, expected));
  }
  const auto bad =
      std::find_if(values.begin(), values.end(), [](float value) { return !std::isfinite(value); });
  if (bad != values.end()) {
    throw DataError(fmt::format("Number {} of the Gaussians' {} is not finite: remove or mend it",
                                bad - values.begin(), name));
  }
}

}  // namespace

void check_gaussians(const Gaussians& gaussians) {
  if (gaussians.sh_degree < 0 || gaussians.sh_degree > 4) {
    throw UsageError(
        fmt::format("The Gaussians have SH degree {}: 0 to 4 are possible", gaussians.sh_degree));
  }
  const std::size_t n = gaussians.size();
  check_array("means", gaussians.means, 3 * n);
  check_array("quaternions", gaussians.quaternions, 4 * n);
  check_array("log_scales", gaussians.log_scales, 3 * n);
  check_array("opacities", gaussians.opacities, n);
  check_array("sh", gaussians.sh,
              3 * n * static_cast<std::size_t>(sh_coefficients(gaussians.sh_degree)));
}

namespace {

DeviceGaussians upload(Context& context, const Gaussians& gaussians) {
  check_gaussians(gaussians);
  const auto lock = context.lock();
  return DeviceGaussians::upload(context, gaussians, ScaleActivation::kExp);
}

}  // namespace

Model::Model(Context& context, const Gaussians& gaussians)
    : impl_(new Impl{context, upload(context, gaussians)}) {}
Model::~Model() = default;
Model::Model(Model&&) noexcept = default;
Model& Model::operator=(Model&&) noexcept = default;

void Model::assign(const Gaussians& gaussians) {
  const auto lock = impl_->context.lock();
  impl_->gaussians = upload(impl_->context, gaussians);
}

Gaussians Model::download() const {
  const auto lock = impl_->context.lock();
  return impl_->gaussians.download();
}

std::size_t Model::size() const { return impl_->gaussians.count; }
int Model::sh_degree() const { return impl_->gaussians.sh_degree; }
std::uint64_t Model::revision() const { return impl_->gaussians.revision; }
Context& Model::context() const { return impl_->context; }

const DeviceGaussians& gaussians_of(const Model& model, const Context& context) {
  if (&model.context() != &context) {
    throw UsageError(
        "The model belongs to another context than its tracer: make both with the same one");
  }
  return model.impl().gaussians;
}

}  // namespace raysplats
