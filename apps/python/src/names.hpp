// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <string>
#include <string_view>

#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "raysplats/rays.hpp"
#include "raysplats/scene.hpp"
#include "raysplats/trace_options.hpp"
#include "scene/camera/photo_lens.hpp"

namespace raysplats::python {

/// Python's name of a value of an enumeration: the word that configuration files and options have.
template <class E>
struct Name {
  std::string_view name;
  E value;
};

inline constexpr std::array<Name<HitOrder>, 2> kHitOrders{
    {{"entry", HitOrder::kEntry}, {"peak", HitOrder::kPeak}}};
inline constexpr std::array<Name<Traversal>, 3> kTraversals{
    {{"auto", Traversal::kAuto}, {"tiles", Traversal::kTiles}, {"bvh", Traversal::kBvh}}};
inline constexpr std::array<Name<PacketShape>, 4> kPacketShapes{
    {{"auto", PacketShape::kAuto},
     {"vector", PacketShape::kVector},
     {"group", PacketShape::kGroup},
     {"subgroup", PacketShape::kSubgroup}}};
inline constexpr std::array<Name<GradientSum>, 5> kGradientSums{{{"auto", GradientSum::kAuto},
                                                                 {"copies", GradientSum::kCopies},
                                                                 {"exact", GradientSum::kExact},
                                                                 {"atomic", GradientSum::kAtomic},
                                                                 {"swap", GradientSum::kSwap}}};
inline constexpr std::array<Name<ColorDirection>, 2> kColorDirections{
    {{"ray", ColorDirection::kRay}, {"from-origin", ColorDirection::kFromOrigin}}};
inline constexpr std::array<Name<CameraModel>, 6> kCameraModels{
    {{"pinhole", CameraModel::kPinhole},
     {"opencv", CameraModel::kOpenCv},
     {"fisheye", CameraModel::kFisheye},
     {"equirectangular", CameraModel::kEquirectangular},
     {"orthographic", CameraModel::kOrthographic},
     {"photo-lens", CameraModel::kPhotoLens}}};
/// In pickles alone.
inline constexpr std::array<Name<PhotoLens::Form>, 5> kPhotoLensForms{
    {{"perspective", PhotoLens::Form::kPerspective},
     {"fisheye", PhotoLens::Form::kFisheye},
     {"fov", PhotoLens::Form::kFov},
     {"division", PhotoLens::Form::kDivision},
     {"eucm", PhotoLens::Form::kEucm}}};
inline constexpr std::array<Name<Split>, 3> kSplits{
    {{"train", Split::kTrain}, {"test", Split::kTest}, {"all", Split::kAll}}};
inline constexpr std::array<Name<MaskUse>, 2> kMaskUses{
    {{"ignore", MaskUse::kIgnore}, {"cutout", MaskUse::kCutout}}};
inline constexpr std::array<Name<AlphaUse>, 3> kAlphaUses{
    {{"auto", AlphaUse::kAuto}, {"ignore", AlphaUse::kIgnore}, {"cutout", AlphaUse::kCutout}}};
inline constexpr std::array<Name<BorderUse>, 2> kBorderUses{
    {{"auto", BorderUse::kAuto}, {"keep", BorderUse::kKeep}}};
inline constexpr std::array<Name<SpzAxes>, 2> kSpzAxes{
    {{"ply", SpzAxes::kPly}, {"rub", SpzAxes::kRub}}};
inline constexpr std::array<Name<DatasetKind>, 5> kDatasetKinds{
    {{"colmap", DatasetKind::kColmap},
     {"blender", DatasetKind::kBlender},
     {"nerfstudio", DatasetKind::kNerfstudio},
     {"llff", DatasetKind::kLlff},
     {"polycam", DatasetKind::kPolycam}}};
inline constexpr std::array<Name<DeviceType>, 4> kDeviceTypes{
    {{"cpu", DeviceType::kCpu},
     {"gpu", DeviceType::kGpu},
     {"accelerator", DeviceType::kAccelerator},
     {"other", DeviceType::kOther}}};
inline constexpr std::array<Name<Material::Kind>, 5> kMaterialKinds{
    {{"diffuse", Material::Kind::kDiffuse},
     {"mirror", Material::Kind::kMirror},
     {"glass", Material::Kind::kGlass},
     {"transparent", Material::Kind::kTransparent},
     {"emissive", Material::Kind::kEmissive}}};
inline constexpr std::array<Name<Light::Kind>, 3> kLightKinds{
    {{"point", Light::Kind::kPoint},
     {"directional", Light::Kind::kDirectional},
     {"sphere", Light::Kind::kSphere}}};

template <class E, std::size_t N>
std::string name_of(const std::array<Name<E>, N>& names, E value) {
  for (const Name<E>& each : names) {
    if (each.value == value) return std::string(each.name);
  }
  return "";
}

/// The value called `text`; throws UsageError that lists the names of `what`.
template <class E, std::size_t N>
E value_of(const std::array<Name<E>, N>& names, const char* what, std::string_view text) {
  std::string known;
  for (std::size_t i = 0; i < N; ++i) {
    if (names[i].name == text) return names[i].value;
    known += fmt::format("{}'{}'", i == 0 ? "" : i + 1 < N ? ", " : " or ", names[i].name);
  }
  throw UsageError(fmt::format("{} is {}, not '{}'", what, known, text));
}

}  // namespace raysplats::python
