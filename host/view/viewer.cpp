// SPDX-License-Identifier: Apache-2.0
#include "view/viewer.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>
#include <variant>

#include "raysplats/error.hpp"
#include "scene/camera/camera_model.hpp"
#include "util/clock.hpp"
#include "view/picture_file.hpp"
#include "view/viewer_impl.hpp"

namespace raysplats::view {
namespace {

constexpr int kMovingQuality = 60;
constexpr int kStillQuality = 85;
constexpr int kLastQuality = 94;
/// From one wish of a page to the next: screens show no more, and whoever wishes more gets the
/// newest of them.
constexpr std::chrono::nanoseconds kWishTime{1'000'000'000 / 60};

/// Pictures are sent at 1, 2, 4, 8, ... samples, and at the last one.
bool worth_sending(std::uint64_t samples, std::uint64_t most) {
  return samples == most || (samples & (samples - 1)) == 0;
}

/// Sees one pixel, at a place that is given in shares of the picture.
Camera pixel_of(Camera camera, double x, double y) {
  x *= camera.width;
  y *= camera.height;
  if (camera.model == CameraModel::kPinhole) {
    camera.cx += 0.5 - x;
    camera.cy += 0.5 - y;
    camera.width = camera.height = 1;
    return camera;
  }
  // What other lenses call near is near along the ray, as it is for a pinhole that looks there.
  const CameraRay ray = camera_ray(camera, x, y);
  const glm::dvec3 up = std::abs(ray.direction.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
  return look_at(ray.origin, ray.origin + ray.direction, up, 1, 1, camera.fy);
}

void add(Image& sum, const Image& image) {
  if (sum.pixels() == 0) {
    sum = image;
    return;
  }
  for (std::size_t i = 0; i < sum.data.size(); ++i) sum.data[i] += image.data[i];
}

Image divided(const Image& sum, std::uint64_t samples) {
  Image out = sum;
  const float scale = 1.0f / static_cast<float>(samples);
  for (float& value : out.data) value *= scale;
  return out;
}

}  // namespace

void Viewer::Impl::answer(PictureSource& source, ClientId id, const PickRequest& pick) {
  ViewRequest request = pick.view;
  request.camera = pixel_of(request.camera, pick.x, pick.y);
  nlohmann::json reply{{"type", "pick"}, {"id", pick.id}, {"point", nullptr}};
  try {
    if (const std::optional<glm::dvec3> point = source.point(request))
      reply["point"] = {point->x, point->y, point->z};
    server.send_text(id, reply.dump());
  } catch (const std::exception& error) {
    complain(id, sentence(error, kNoRoomForPicture));
  }
}

void Viewer::Impl::give_up(ClientId id, std::uint64_t wish, const std::exception& error) {
  const std::string what = sentence(error, kNoRoomForPicture);
  // A page that moves asks many times a second.
  if (dynamic_cast<const UsageError*>(&error) == nullptr && what != last_trouble)
    spdlog::warn("no picture for the page: {}", what);
  last_trouble = what;
  complain(id, what);
  const std::lock_guard<std::mutex> guard(mutex);
  const auto found = clients.find(id);
  if (found != clients.end() && found->second.wish == wish) found->second.wanted.reset();
}

void Viewer::Impl::obey(ClientId id, MeshMessage message) {
  DroppedMeshes& meshes = *options.meshes;
  bool moving = false;
  try {
    if (auto* sent = std::get_if<SentMesh>(&message)) {
      note(id, "Placing " + sent->offer.name +
                   ": the first mesh takes a minute where its kernels are still to be compiled");
      meshes.add(std::move(*sent));
    } else if (const auto* place = std::get_if<PlaceMesh>(&message)) {
      meshes.place(place->mesh, place->placement);
      moving = place->moving;
    } else if (const auto* remove = std::get_if<RemoveMesh>(&message)) {
      meshes.remove(remove->mesh);
    } else if (std::holds_alternative<MeshQuestion>(message)) {
      return server.send_text(id, meshes.json());
    } else {
      const nlohmann::json reply{
          {"type", "scene"}, {"text", meshes.scene_text(std::get<SceneQuestion>(message).camera)}};
      return server.send_text(id, reply.dump());
    }
  } catch (const std::exception& error) {
    excuse(id, error, kNoRoomForMesh);
    return server.send_text(id, meshes.json());
  }
  refresh();
  if (!moving) tell(meshes.json());
}

void Viewer::Impl::tell(const std::string& json) {
  const std::lock_guard<std::mutex> guard(mutex);
  for (const auto& each : clients) server.send_text(each.first, json);
}

void Viewer::Impl::refresh() {
  const std::lock_guard<std::mutex> guard(mutex);
  for (auto& each : clients) {
    if (!each.second.wanted || each.second.wanted->moving) continue;
    each.second.drawn = 0;
    each.second.sum = {};
  }
}

void Viewer::Impl::draw(PictureSource& source,
                        std::int64_t iteration,
                        ClientId id,
                        const std::function<bool()>& stop) {
  Order order;
  {
    // It may have gone since it was chosen.
    const std::lock_guard<std::mutex> guard(mutex);
    const auto found = clients.find(id);
    if (found == clients.end() || !found->second.wanted) return;
    Client& client = found->second;
    if (client.fresh) client.due = Clock::now() + kWishTime;
    client.fresh = false;
    order.request = *client.wanted;
    if (order.request.moving) {
      order.pace = client.pace;
    } else if (hurry > 0.0 && !order.request.png) {
      order.pace = client.rest;
    }
    order.wish = client.wish;
    order.sample = client.drawn;
    client.turn = ++turns;
  }
  try {
    deliver(source, iteration, id, order, stop);
  } catch (const std::exception& error) {
    give_up(id, order.wish, error);
  }
}

void Viewer::Impl::deliver(PictureSource& source,
                           std::int64_t iteration,
                           ClientId id,
                           Order& order,
                           const std::function<bool()>& stop) {
  ViewRequest& request = order.request;
  const std::optional<Pace>& pace = order.pace;
  const std::uint64_t wish = order.wish;
  const std::uint64_t sample = order.sample;
  if (pace) request.camera = pace->sized(request.camera);
  const auto watch = [&](double) {
    if (stop && stop()) return false;
    // Small pictures are done before a newer one could be; large ones make room at once for this
    // page's newer wish and for whoever moves.
    if (request.moving) return true;
    const std::lock_guard<std::mutex> guard(mutex);
    return std::none_of(clients.begin(), clients.end(), [&](const auto& each) {
      const Client& client = each.second;
      if (each.first == id) return client.wish != wish;
      return client.wanted && client.wanted->moving && client.drawn == 0 &&
             client.ready(Clock::now());
    });
  };
  const auto start = Clock::now();
  Image picture = source.draw(request, sample, watch);
  const double seconds = seconds_since(start);
  if (picture.pixels() == 0) return;
  const std::uint64_t most = samples_of(request, source.samples());
  PictureHeader header;
  header.view = request.id;
  header.iteration = iteration;
  header.milliseconds = static_cast<float>(1e3 * seconds);
  {
    const std::lock_guard<std::mutex> guard(mutex);
    const auto found = clients.find(id);
    if (found == clients.end()) return;
    Client& client = found->second;
    if (pace) {
      Pace& own = request.moving ? client.pace : client.rest;
      own.record(static_cast<double>(picture.pixels()), seconds);
    }
    // A still picture that is no longer wanted; one of a movement is better than none.
    if (client.wish != wish && !request.moving) return;
    if (client.wish == wish) {
      client.drawn = sample + 1;
      if (sample + 1 == most) client.wanted->png = false;  // it is kept once
      if (most > 1) {
        add(client.sum, picture);
        picture = client.sum;
      }
    }
  }
  const std::uint64_t samples = most > 1 ? sample + 1 : 1;
  header.samples = static_cast<std::uint32_t>(samples);
  header.last = samples == most && !request.moving;
  header.png = request.png && header.last;
  if (!request.moving && !worth_sending(samples, most)) return;
  if (samples > 1) picture = divided(picture, samples);
  const int quality =
      request.moving ? kMovingQuality : (header.last ? kLastQuality : kStillQuality);
  server.send_picture(id, picture_message(header, picture, quality), header.png);
}

Viewer::Viewer(const ViewerOptions& options) : impl_(std::make_unique<Impl>(options)) {}

Viewer::~Viewer() = default;

std::vector<std::string> Viewer::urls() const { return impl_->server.urls(); }

std::size_t Viewer::watchers() const {
  const std::lock_guard<std::mutex> guard(impl_->mutex);
  return static_cast<std::size_t>(
      std::count_if(impl_->clients.begin(), impl_->clients.end(),
                    [](const auto& each) { return each.second.wanted.has_value(); }));
}

bool Viewer::awaited() const {
  const std::lock_guard<std::mutex> guard(impl_->mutex);
  return std::any_of(impl_->clients.begin(), impl_->clients.end(), [](const auto& each) {
    const Client& client = each.second;
    return client.wanted && client.wanted->moving && client.drawn == 0;
  });
}

bool Viewer::asked() const {
  const std::lock_guard<std::mutex> guard(impl_->mutex);
  return !impl_->commands.empty() || !impl_->picks.empty();
}

double Viewer::seconds_since_motion() const {
  const std::lock_guard<std::mutex> guard(impl_->mutex);
  return impl_->last_motion ? seconds_since(*impl_->last_motion)
                            : std::numeric_limits<double>::infinity();
}

void Viewer::on_command(std::function<void(RunCommand)> handler) {
  impl_->on_command = std::move(handler);
}

void Viewer::tell(const std::string& json) { impl_->tell(json); }

void Viewer::tell_last(const std::string& json) {
  tell(json);
  impl_->server.flush(1.0);
}

void Viewer::refresh() { impl_->refresh(); }

void Viewer::set_hurry(double seconds) {
  const std::lock_guard<std::mutex> guard(impl_->mutex);
  if (impl_->hurry == seconds) return;
  impl_->hurry = seconds;
  for (auto& each : impl_->clients) each.second.rest = Pace(seconds);
}

bool Viewer::work(PictureSource& source,
                  std::int64_t iteration,
                  double wait,
                  const std::function<bool()>& stop) {
  Impl& self = *impl_;
  std::optional<ClientId> client;
  std::optional<std::pair<ClientId, PickRequest>> pick;
  std::deque<RunCommand> commands;
  std::optional<std::pair<ClientId, MeshMessage>> about_mesh;
  {
    std::unique_lock<std::mutex> lock(self.mutex);
    const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                        std::chrono::duration<double>(wait));
    auto now = Clock::now();
    for (; !self.has_work(source.samples(), now); now = Clock::now()) {
      if (now >= end) return false;
      self.news.wait_until(lock, std::min(end, self.next_due(now)));
    }
    commands.swap(self.commands);
    about_mesh = self.about_meshes.take();
    const std::optional<ClientId> asks = about_mesh ? std::nullopt : self.next_pick(now);
    if (asks) {
      pick.emplace(*asks, std::move(self.picks.extract(*asks).mapped()));
      self.clients.at(*asks).due = now + kWishTime;
    } else if (!about_mesh) {
      client = self.next(source.samples(), now);
    }
  }
  for (const RunCommand command : commands) {
    if (self.on_command) self.on_command(command);
  }
  if (about_mesh) {
    self.obey(about_mesh->first, std::move(about_mesh->second));
  } else if (pick) {
    self.answer(source, pick->first, pick->second);
  } else if (client) {
    self.draw(source, iteration, *client, stop);
  }
  return true;
}

}  // namespace raysplats::view
