// SPDX-License-Identifier: Apache-2.0
#include "report/camera_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/glm.hpp>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "io/dataset/camera_list.hpp"
#include "report/html.hpp"
#include "report/run_files.hpp"

namespace raysplats::report {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr double kWidth = 460.0;
constexpr double kHeight = 300.0;
constexpr double kMargin = 34.0;
constexpr double kLegendLine = 13.0;
constexpr double kLook = 14.0;            ///< length of the line that says where a camera looks
constexpr std::size_t kMostDrawn = 1500;  ///< of a kind, so that the page stays small
constexpr std::size_t kMostNamed = 300;   ///< of what was trained on, for the same reason
constexpr double kFarthest = 1e12;        ///< what is farther away is a broken file's

struct Place {
  glm::dvec3 center;
  glm::dvec3 look{0};  ///< where it looks, of length 1; 0 for unknown
  std::optional<double> psnr = {};
  std::string name = {};
};

bool is_near(const glm::dvec3& point) {
  return glm::all(glm::lessThan(glm::abs(point), glm::dvec3(kFarthest)));
}

/// Where a view of an evaluation stands.
std::optional<glm::dvec3> center_of(const Json& view) {
  const Json center = view.value("center", Json());
  if (!center.is_array() || center.size() != 3) return std::nullopt;
  glm::dvec3 out;
  for (int i = 0; i < 3; ++i) {
    const Json& value = center.at(static_cast<std::size_t>(i));
    if (!value.is_number()) return std::nullopt;
    out[i] = value.get<double>();
  }
  return is_near(out) ? std::optional(out) : std::nullopt;
}

std::vector<std::optional<Camera>> listed_cameras(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return {};
  return io::read_camera_list(path);
}

glm::dvec3 unit(const glm::dvec3& v, const glm::dvec3& otherwise) {
  const double length = glm::length(v);
  return length > 1e-9 ? v / length : otherwise;
}

struct Cameras {
  std::vector<Place> trained, held_out;
  glm::dvec3 up{0, 0, 1};
};

Cameras cameras_of(const fs::path& run,
                   const std::vector<Json>& views,
                   const std::vector<Json>& photos) {
  Cameras out;
  std::map<std::string, double> measured;
  for (const Json& photo : photos) {
    if (photo.contains("psnr")) measured[text(photo, "name")] = number(photo, "psnr");
  }
  glm::dvec3 up{0};
  for (const std::optional<Camera>& camera : listed_cameras(run / "cameras.json")) {
    if (!camera || !is_near(camera->center())) continue;
    const glm::dmat3 axes = glm::transpose(camera->rotation);  // right, down and forward
    up -= axes[1];
    Place place{camera->center(), axes[2], std::nullopt, camera->name};
    if (const auto found = measured.find(place.name); found != measured.end())
      place.psnr = found->second;
    out.trained.push_back(place);
  }
  for (const Json& view : views) {
    const std::optional<glm::dvec3> center = center_of(view);
    if (center) out.held_out.push_back({*center, {}, number(view, "psnr"), text(view, "name")});
  }
  out.up = unit(up, out.up);
  return out;
}

/// Across and upwards on the page, in the world.
struct Sheet {
  glm::dvec3 right, up;
  glm::dvec2 of(const glm::dvec3& v) const { return {glm::dot(v, right), glm::dot(v, up)}; }
};

/// The horizontal direction in which the cameras reach farthest.
glm::dvec3 along(const Cameras& cameras) {
  const glm::dvec3 up = cameras.up;
  const glm::dvec3 other = std::abs(up.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const Sheet ground{glm::normalize(glm::cross(other, up)),
                     glm::cross(up, glm::normalize(glm::cross(other, up)))};
  glm::dvec2 mean{0};
  double count = 0;
  const auto all = [&](const auto& use) {
    for (const auto* places : {&cameras.trained, &cameras.held_out}) {
      for (const Place& place : *places) use(ground.of(place.center));
    }
  };
  all([&](const glm::dvec2& p) { mean += p, ++count; });
  mean /= std::max(count, 1.0);
  double xx = 0, xy = 0, yy = 0;
  all([&](const glm::dvec2& p) {
    const glm::dvec2 d = p - mean;
    xx += d.x * d.x, xy += d.x * d.y, yy += d.y * d.y;
  });
  const double angle = 0.5 * std::atan2(2 * xy, xx - yy);
  return std::cos(angle) * ground.right + std::sin(angle) * ground.up;
}

/// From orange, the least, over grey to blue, which those who see no red or green tell apart.
std::string color(double share) {
  const glm::dvec3 low{214, 96, 30}, middle{170, 165, 155}, high{60, 120, 215};
  const glm::dvec3 mixed =
      share < 0.5 ? glm::mix(low, middle, 2 * share) : glm::mix(middle, high, 2 * share - 1);
  return fmt::format("rgb({:.0f},{:.0f},{:.0f})", mixed.r, mixed.g, mixed.b);
}

/// The least and the greatest PSNR of these.
struct Range {
  double worst = std::numeric_limits<double>::infinity(), best = -worst;
  std::size_t count = 0;  ///< that have one

  explicit Range(const std::vector<Place>& places) {
    for (const Place& place : places) {
      if (!place.psnr) continue;
      worst = std::min(worst, *place.psnr);
      best = std::max(best, *place.psnr);
      ++count;
    }
  }
  std::string color_of(double psnr) const {
    return color(best > worst ? (psnr - worst) / (best - worst) : 0.5);
  }
  std::string text() const {
    return fmt::format("orange {:.2f} dB to blue {:.2f} dB", worst, best);
  }
};

std::string drawn(const std::string& title, const Cameras& cameras, const Sheet& sheet) {
  glm::dvec2 low(std::numeric_limits<double>::infinity()), high(-low);
  // Photos that a run has seen are better than others: each kind has colours of its own.
  const Range trained(cameras.trained), held_out(cameras.held_out);
  for (const auto* places : {&cameras.trained, &cameras.held_out}) {
    for (const Place& place : *places) {
      low = glm::min(low, sheet.of(place.center));
      high = glm::max(high, sheet.of(place.center));
    }
  }
  const glm::dvec2 room(kWidth - 2 * kMargin, kHeight - 2 * kMargin);
  const glm::dvec2 size = glm::max(high - low, glm::dvec2(1e-9));
  const double scale = std::min(room.x / size.x, room.y / size.y);
  const auto at = [&](const glm::dvec3& place) {
    const glm::dvec2 p = scale * (sheet.of(place) - 0.5 * (low + high));
    return glm::dvec2(0.5 * kWidth + p.x, 0.5 * kHeight - p.y);
  };
  std::string out = fmt::format(
      "<svg viewBox=\"0 0 {0:.0f} {1:.0f}\" role=\"img\" aria-label=\"{2}\"><text x=\"12\" "
      "y=\"16\" class=\"title\">{2}</text>",
      kWidth, kHeight, escaped(title));
  const auto spread = [](const std::vector<Place>& places, const auto& draw) {
    const std::size_t step = places.size() / kMostDrawn + 1;
    for (std::size_t i = 0; i < places.size(); i += step) draw(places[i]);
  };
  const auto disc = [](const glm::dvec2& center, int radius, const Place& place, const Range& range,
                       bool named) {
    const double psnr = place.psnr.value_or(0.0);
    const std::string circle =
        fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" fill=\"{}\"", center.x, center.y,
                    radius, range.color_of(psnr));
    if (!named) return circle + "/>";
    return fmt::format("{}><title>{}, {:.2f} dB</title></circle>", circle, escaped(place.name),
                       psnr);
  };
  const bool named = cameras.trained.size() <= kMostNamed;
  spread(cameras.trained, [&](const Place& place) {
    const glm::dvec2 from = at(place.center);
    const glm::dvec2 look = kLook * sheet.of(place.look);
    out += fmt::format(
        "<line class=\"look\" x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\"/>", from.x,
        from.y, from.x + look.x, from.y - look.y);
    out += place.psnr ? disc(from, 3, place, trained, named)
                      : fmt::format("<circle class=\"plain\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\"/>",
                                    from.x, from.y);
  });
  spread(cameras.held_out,
         [&](const Place& place) { out += disc(at(place.center), 5, place, held_out, true); });
  std::vector<std::string> legend;
  if (held_out.count > 0) legend.push_back("large, held out: " + held_out.text());
  if (trained.count > 0) legend.push_back("small, trained on: " + trained.text());
  const bool all = trained.count == cameras.trained.size();
  if (trained.count == 0) {
    legend.emplace_back("grey: trained on");
  } else if (!all) {
    legend.back() += "; grey: not yet at full size";
  }
  for (std::size_t i = 0; i < legend.size(); ++i) {
    out += fmt::format("<text x=\"12\" y=\"{}\">{}</text>",
                       kHeight - 6 - kLegendLine * static_cast<double>(legend.size() - 1 - i),
                       legend[i]);
  }
  return out + "</svg>\n";
}

}  // namespace

std::string camera_map(const fs::path& run,
                       const std::vector<Json>& views,
                       const std::vector<Json>& photos) {
  const Cameras cameras = cameras_of(run, views, photos);
  if (cameras.trained.empty() && cameras.held_out.empty()) return "";
  const glm::dvec3 right = along(cameras);
  return drawn("From above", cameras, {right, glm::cross(cameras.up, right)}) +
         drawn("From the side", cameras, {right, cameras.up});
}

}  // namespace raysplats::report
