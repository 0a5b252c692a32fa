// SPDX-License-Identifier: Apache-2.0
#include "trace/candidate_lists.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <iterator>
#include <numbers>

#include "raysplats/error.hpp"
#include "scene/camera/camera_check.hpp"
#include "scene/camera/pixel_spacing.hpp"

namespace raysplats {
namespace {

// Vector loads of boxes may run past the end of a list by one vector.
constexpr std::size_t kBoxPadding = 16;
constexpr std::size_t kGatherGroup = 64;
// Keys are a depth below the number of a tile, which has 16 bits as well.
constexpr int kDepthBits = 16;
// Tile numbers have 16 bits.
constexpr std::size_t kMaxTiles = 65535;
// What the sort takes; a sum that does not fit 32 bits reads as Scan::kMost, which is more.
constexpr std::size_t kMaxCandidates = (std::size_t{1} << 31) - 1;

// What the kernels divide by or turn into whole numbers.
void check_camera(const Camera& camera, const RsCamera& converted) {
  const std::array<float, 4> intrinsics{converted.fx, converted.fy, converted.cx, converted.cy};
  const auto finite = [](float value) { return std::isfinite(value); };
  if (!std::all_of(intrinsics.begin(), intrinsics.end(), finite) ||
      !std::all_of(std::begin(converted.rotation), std::end(converted.rotation), finite) ||
      !std::all_of(std::begin(converted.center), std::end(converted.center), finite)) {
    throw UsageError(fmt::format(
        "The camera '{}' has a number that is not finite or beyond single precision: correct it",
        camera.name));
  }
  if (!(converted.fx > 0) || !(converted.fy > 0)) {
    throw UsageError(fmt::format("The camera '{}' has no positive focal length", camera.name));
  }
  if (camera.width < 1 || camera.height < 1 || camera.width > kMaxSide ||
      camera.height > kMaxSide) {
    throw UsageError(fmt::format("The camera '{}' has {} x {} pixels: 1 to {} a side are possible",
                                 camera.name, camera.width, camera.height, kMaxSide));
  }
}

}  // namespace

int lens_kind(const Camera& camera) {
  if (camera.model == CameraModel::kPinhole) return RS_LENS_PINHOLE;
  return camera.model == CameraModel::kOpenCv ? RS_LENS_AXIAL : RS_LENS_AROUND;
}

RsCamera device_camera(const Camera& camera, const TraceOptions& options, int face) {
  if (camera.model == CameraModel::kOrthographic) {
    throw UsageError(fmt::format(
        "The camera '{}' is orthographic, and packets of rays are made for cameras with "
        "a centre: trace its rays one by one, traversal auto or bvh",
        camera.name));
  }
  RsCamera out{};
  const glm::dmat3 rotation = LensTiles::rotation(face) * camera.rotation;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      out.rotation[3 * row + column] = static_cast<float>(rotation[column][row]);
    }
  }
  const glm::dvec3 center = camera.center();
  for (int j = 0; j < 3; ++j) out.center[j] = static_cast<float>(center[j]);
  // A panorama has no focal length: an angle of 1 is width / (2 pi) pixels.
  const bool around = camera.model == CameraModel::kEquirectangular;
  out.fx = static_cast<float>(around ? camera.width / (2 * std::numbers::pi) : camera.fx);
  out.fy = static_cast<float>(around ? camera.height / std::numbers::pi : camera.fy);
  out.cx = static_cast<float>(camera.cx);
  out.cy = static_cast<float>(camera.cy);
  out.width = camera.width;
  out.height = camera.height;
  out.near_depth = options.near_depth;
  out.footprint = footprint_width(camera, options.view_footprint);
  check_camera(camera, out);
  return out;
}

std::array<TileWindow, 2> TileWindow::halves() const {
  TileWindow first = *this;
  TileWindow second = *this;
  if (rows > 1) {
    first.rows = rows / 2;
    second.row += first.rows;
    second.rows -= first.rows;
  } else {
    first.columns = columns / 2;
    second.column += first.columns;
    second.columns -= first.columns;
  }
  return {first, second};
}

CandidateLists::CandidateLists(Context& context, int tile_size)
    : context_(&context), tile_size_(tile_size), sort_(context), scan_(context) {
  BuildOptions build;
  build.define("TILE", tile_size);
  gather_kernel_ = context.kernel("trace/tile_lists.cl", "gather_candidates", build);
  admit_kernel_ = context.kernel("trace/view_sizes.cl", "admit_candidates");
  live_ = Buffer<std::uint32_t>(context, 2, "listed candidates");
  fitted_ = Buffer<std::uint32_t>(context, 1, "no overflow");
  fitted_.clear();
}

void CandidateLists::begin_programs(const DeviceGaussians& gaussians,
                                    int lens,
                                    const TraceOptions& options) {
  const bool sigmoid = gaussians.activation == ScaleActivation::kSigmoid;
  const bool peak = options.hit_order == HitOrder::kPeak;
  const int coefficients = sh_coefficients(gaussians.sh_degree);
  const int variant = (sigmoid ? 1 : 0) | (peak ? 2 : 0) | (options.adaptive_radius ? 4 : 0) |
                      gaussians.active_sh_degree << 3 | coefficients << 8 | lens << 16 |
                      (options.view_footprint > 0 ? 1 << 18 : 0);
  if (variant == prepared_variant_) return;
  BuildOptions build;
  build.define("SIGMOID_SCALE", sigmoid ? 1 : 0)
      .define("PEAK_ORDER", peak ? 1 : 0)
      .define("ADAPTIVE_RADIUS", options.adaptive_radius ? 1 : 0)
      .define("LENS", lens)
      .define("VIEW_FOOTPRINT", options.view_footprint > 0 ? 1 : 0)
      .define("SH_DEGREE", gaussians.active_sh_degree)
      .define("SH_COEFFICIENTS", coefficients);
  prepare_kernel_ = GaussianKernel(*context_, "trace/prepare_view.cl", "prepare_view", build);
  BuildOptions lists;
  lists.define("TILE", tile_size_).define("PEAK_ORDER", peak ? 1 : 0).define("LENS", lens);
  count_kernel_ = GaussianKernel(*context_, "trace/tile_lists.cl", "count_tiles", lists);
  fill_kernel_ = GaussianKernel(*context_, "trace/tile_lists.cl", "fill_tiles", lists);
  sort_.begin_programs(kDepthBits + 1);  // as many passes as pictures of 2 to 256 tiles take
  prepared_variant_ = variant;
}

void CandidateLists::prepare(const DeviceGaussians& gaussians,
                             const RsCamera& camera,
                             const ViewFace& face,
                             const TraceOptions& options) {
  if (gaussians.count >= (std::size_t{1} << 31)) {
    throw ResourceError(fmt::format(
        "{} Gaussians are more than the 2^31 - 1 that one scene can hold", gaussians.count));
  }
  begin_programs(gaussians, face.lens, options);
  face_ = face;
  count_ = gaussians.count;
  tiles_x_ = static_cast<std::uint32_t>((camera.width + tile_size_ - 1) / tile_size_);
  tile_rows_ = static_cast<std::uint32_t>((camera.height + tile_size_ - 1) / tile_size_);
  lines_.ensure(*context_, count_, "lines of the view");
  bounds_.ensure(*context_, count_, "bounds of the view");
  std::array<float, 4> window{-camera.cx / camera.fx, -camera.cy / camera.fy,
                              (static_cast<float>(camera.width) - camera.cx) / camera.fx,
                              (static_cast<float>(camera.height) - camera.cy) / camera.fy};
  if (face.tiles != nullptr) window = face.tiles->window(face.face);
  prepare_kernel_.launch(count_, gaussians.arguments(), camera, options.quantile, window, lines_,
                         bounds_);
}

std::size_t CandidateLists::allowed(std::size_t budget) const {
  // The largest buffer is that of the boxes: four floats each, and those of the padding.
  const std::size_t boxes = context_->device().max_allocation / (4 * sizeof(float)) - kBoxPadding;
  return std::min<std::size_t>({budget / kBytesPerCandidate, boxes, kMaxCandidates});
}

// Leaves the number of candidates at the end of offsets_.
void CandidateLists::count(const Buffer<RsAabb>& boxes,
                           const RsCamera& camera,
                           const TileWindow& window) {
  tile_offsets_.ensure(*context_, window.tiles() + 1, "tile offsets");
  offsets_.ensure(*context_, count_ + 1, "candidate offsets");
  if (count_ == 0) {
    offsets_.clear();
    return;
  }
  if (face_.tiles != nullptr) {
    count_kernel_.launch(count_, bounds_, boxes, camera, window, offsets_, face_.face,
                         face_.tiles->tiles(), face_.tiles->spans(face_.face));
  } else {
    count_kernel_.launch(count_, bounds_, boxes, camera, window, offsets_);
  }
  scan_.exclusive(offsets_, count_);
}

// Lists what count() found when that is `capacity` at most: launches are made for so many.
void CandidateLists::fill(const Buffer<RsAabb>& boxes,
                          const RsCamera& camera,
                          const TileWindow& window,
                          std::size_t capacity,
                          std::size_t room,
                          bool anew,
                          Buffer<std::uint32_t>& counters,
                          Buffer<std::uint32_t>& overflow) {
  const auto tiles = static_cast<std::uint32_t>(window.tiles());
  stride_ = static_cast<std::uint32_t>(room + kBoxPadding);
  admit_kernel_.launch(Range{{1, 1, 1}, {1, 1, 1}, {}}, offsets_,
                       static_cast<std::uint32_t>(count_), boxes, camera,
                       static_cast<std::uint32_t>(capacity), anew ? u32(counters.size()) : 0u,
                       live_, counters, overflow);
  if (face_.tiles != nullptr) {
    fill_kernel_.launch(count_, bounds_, boxes, lines_, camera, window, offsets_, face_.face,
                        face_.tiles->tiles(), face_.tiles->spans(face_.face), live_, keys_,
                        values_);
  } else {
    fill_kernel_.launch(count_, bounds_, boxes, lines_, camera, window, offsets_, live_, keys_,
                        values_);
  }
  sort_.sort(keys_, values_, live_, room, kDepthBits + std::bit_width(tiles - 1));
  gather_kernel_.launch(Range::linear(std::max<std::size_t>(room, 1), kGatherGroup), live_, stride_,
                        tiles, keys_, values_, bounds_, boxes_, limits_, tile_offsets_);
}

bool CandidateLists::build(const Buffer<RsAabb>& boxes,
                           const RsCamera& camera,
                           const TileWindow& window,
                           std::size_t budget,
                           Buffer<std::uint32_t>& counters) {
  if (window.tiles() > kMaxTiles) return false;
  count(boxes, camera, window);
  const std::size_t found = count_ > 0 ? offsets_.read(count_) : 0;
  const std::size_t most = allowed(budget);
  if (found > most && window.tiles() > 1) return false;
  if (capacity_ < found || capacity_ == 0) {
    const std::size_t room = std::min(with_headroom(found), std::max(most, found));
    capacity_ = 0;
    keys_.ensure(*context_, room, "candidate keys");
    values_.ensure(*context_, room, "candidate references");
    limits_.ensure(*context_, room, "candidate limits");
    boxes_.ensure(*context_, 4 * (room + kBoxPadding), "candidate boxes");
    capacity_ = room;
  }
  fill(boxes, camera, window, found, found, false, counters, fitted_);
  return true;
}

bool CandidateLists::can_build_ahead(std::size_t tiles) const {
  return capacity_ > 0 && tiles <= kMaxTiles;
}

void CandidateLists::build_ahead(const Buffer<RsAabb>& boxes,
                                 const RsCamera& camera,
                                 const TileWindow& window,
                                 std::size_t budget,
                                 bool anew,
                                 Buffer<std::uint32_t>& counters,
                                 Buffer<std::uint32_t>& overflow) {
  const std::size_t room = std::min(capacity_, allowed(budget));
  count(boxes, camera, window);
  fill(boxes, camera, window, room, room, anew, counters, overflow);
}

}  // namespace raysplats
