// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "io/mesh/mesh_file.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats::view {

enum class Output { kColor, kDepth, kAlpha, kNormals, kHits };

/// A picture that the page wants to see.
struct ViewRequest {
  std::uint32_t id = 0;  ///< the page's own number, sent back with the picture
  Camera camera;         ///< at its full size: a pinhole, a fisheye without distortion, a panorama
  Output output = Output::kColor;
  bool moving = false;  ///< more are to follow: speed before size
  bool png = false;     ///< without losses, to be kept
  std::optional<float> near_depth;
  std::optional<HitOrder> hit_order;  ///< else the model's
  std::optional<std::array<float, 3>> background;
};

/// Which point of the world is seen through a point of the picture.
struct PickRequest {
  std::uint32_t id = 0;
  ViewRequest view;
  double x = 0.5, y = 0.5;  ///< 0 to 1 from the picture's upper left corner
};

/// What a page may ask of a training run.
struct RunCommand {
  enum class Kind { kPause, kResume, kSave, kShare };
  Kind kind = Kind::kPause;
  double share = 0;  ///< of kShare: of the run's time that pictures may take, 0 to kMostShare
};
constexpr double kMostShare = 0.9;

/// The page is out of sight: it wants nothing until its next ViewRequest.
struct Leave {};

enum class Surface { kMirror, kGlass, kDiffuse };

/// Where a dropped mesh is and what it is made of: scaled, turned about the fixed axes x, y and z
/// in this order, and the middle of its box then put to `at`, as a scene file does.
struct Placement {
  Surface surface = Surface::kMirror;
  glm::dvec3 at{0.0};      ///< world
  glm::dvec3 rotate{0.0};  ///< degrees
  double size = 1.0;       ///< half the diagonal of its box, world units
};

/// A mesh that is to come in binary messages.
struct MeshOffer {
  io::MeshFormat format = io::MeshFormat::kObj;
  std::string name;       ///< what the page calls its file; nothing here opens it
  std::size_t bytes = 0;  ///< of the file, 1 to kMostMeshBytes
  Placement placement;
};
constexpr std::size_t kMostMeshBytes = std::size_t{32} << 20;

struct PlaceMesh {
  std::uint32_t mesh = 0;  ///< number that it was given
  Placement placement;
  bool moving = false;  ///< more are to follow
};

struct RemoveMesh {
  std::uint32_t mesh = 0;
};

/// Asks for the list of meshes.
struct MeshQuestion {};

/// Asks for the scene file of what the page sees.
struct SceneQuestion {
  Camera camera;
};

using Message = std::variant<ViewRequest,
                             PickRequest,
                             RunCommand,
                             Leave,
                             MeshOffer,
                             PlaceMesh,
                             RemoveMesh,
                             MeshQuestion,
                             SceneQuestion>;

/// Longest message that is parsed, in bytes.
constexpr std::size_t kMaxMessage = 16384;

/// Parses a message of a page, which may be anyone's. Throws UsageError, one sentence, for all that
/// is not understood: other types, numbers that are not finite or out of range, a pose that is no
/// rotation. Sizes are cut to `max_side` pixels, keeping the shape.
Message parse_message(std::string_view text, int max_side);

}  // namespace raysplats::view
