// SPDX-License-Identifier: Apache-2.0
#include "raysplats/model.hpp"

#include "scene/gaussians/gaussian_check.hpp"
#include "trace/model_impl.hpp"

namespace raysplats {
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
