// SPDX-License-Identifier: Apache-2.0
// What pages ask the server for and what they say, in the server's thread; whatever is more than an
// answer waits for Viewer::work().
#include <spdlog/spdlog.h>

#include <charconv>
#include <new>
#include <nlohmann/json.hpp>
#include <utility>
#include <variant>

#include "raysplats/error.hpp"
#include "util/json_text.hpp"
#include "view/page.hpp"
#include "view/viewer_impl.hpp"

namespace raysplats::view {
namespace {

constexpr std::string_view kPhotoPath = "/api/photo/";

}  // namespace

Viewer::Impl::Impl(const ViewerOptions& options_in)
    : options(options_in),
      server(
          options.server,
          {[this](std::string_view path) { return get(path); }, [this](ClientId id) { opened(id); },
           [this](ClientId id, std::string_view text) { heard(id, text); },
           [this](ClientId id, std::span<const std::byte> bytes) { received(id, bytes); },
           [this](ClientId id) { closed(id); }}) {}

HttpReply Viewer::Impl::get(std::string_view path) const {
  try {
    return found(path);
  } catch (const std::exception& error) {
    const std::string what = sentence(error, kNoRoom);
    spdlog::warn("no {} for the page: {}", path, what);
    return {500, "text/plain; charset=utf-8", what + "\n"};
  }
}

HttpReply Viewer::Impl::found(std::string_view path) const {
  if (path == "/api/state") return {200, "application/json", options.state};
  if (path == "/api/run" && options.run) return {200, "application/json", options.run()};
  if (path.starts_with(kPhotoPath) && options.photo) return photo(path.substr(kPhotoPath.size()));
  if (const std::optional<PageFile> file = page_file(path)) return {200, file->type, file->content};
  return {404, "text/plain", "Not found\n"};
}

HttpReply Viewer::Impl::photo(std::string_view number) const {
  std::size_t index = 0;
  const char* end = number.data() + number.size();
  const auto [read, error] = std::from_chars(number.data(), end, index);
  if (error != std::errc() || read != end) return {404, "text/plain", "Not found\n"};
  if (const std::optional<std::string> jpeg = options.photo(index))
    return {200, "image/jpeg", *jpeg};
  return {404, "text/plain", "Not found\n"};
}

void Viewer::Impl::opened(ClientId id) {
  const std::lock_guard<std::mutex> guard(mutex);
  clients[id].pace = Pace(options.moving_seconds);
  clients[id].rest = Pace(hurry);
}

void Viewer::Impl::closed(ClientId id) {
  const std::lock_guard<std::mutex> guard(mutex);
  clients.erase(id);
  picks.erase(id);
  uploads.forget(id);
}

void Viewer::Impl::heard(ClientId id, std::string_view text) {
  try {
    Message message = parse_message(text, options.max_side);
    {
      const std::lock_guard<std::mutex> guard(mutex);
      Client& client = clients[id];
      if (auto* view = std::get_if<ViewRequest>(&message)) {
        client.wanted = std::move(*view);
        client.wish = ++wishes;
        client.fresh = true;
        client.drawn = 0;
        client.sum = {};
        if (client.wanted->moving) last_motion = Clock::now();
      } else if (std::holds_alternative<Leave>(message)) {
        client.wanted.reset();
        client.wish = ++wishes;  // what is drawn of the last one comes too late
      } else if (auto* pick = std::get_if<PickRequest>(&message)) {
        picks[id] = std::move(*pick);
      } else if (auto* command = std::get_if<RunCommand>(&message)) {
        if (commands.size() < kMostWaiting) commands.push_back(*command);
      } else if (options.meshes == nullptr) {
        throw UsageError("Meshes can be dropped into `raysplats view` alone");
      } else if (auto* offer = std::get_if<MeshOffer>(&message)) {
        uploads.begin(id, *offer, Clock::now());
      } else {
        about_meshes.put(id, about_mesh(message));
      }
    }
    news.notify_one();
  } catch (const std::exception& error) {
    excuse(id, error, kNoRoom);
  }
}

void Viewer::Impl::received(ClientId id, std::span<const std::byte> bytes) {
  try {
    {
      const std::lock_guard<std::mutex> guard(mutex);
      std::optional<SentMesh> sent = uploads.take(id, bytes, Clock::now());
      if (!sent) return;
      about_meshes.put(id, std::move(*sent));
    }
    news.notify_one();
  } catch (const std::exception& error) {
    excuse(id, error, kNoRoomForMesh);
  }
}

MeshMessage Viewer::Impl::about_mesh(const Message& message) {
  if (const auto* place = std::get_if<PlaceMesh>(&message)) return *place;
  if (const auto* remove = std::get_if<RemoveMesh>(&message)) return *remove;
  if (std::holds_alternative<MeshQuestion>(message)) return MeshQuestion{};
  return std::get<SceneQuestion>(message);
}

void Viewer::Impl::excuse(ClientId id, const std::exception& error, const char* no_room) {
  const std::string what = sentence(error, no_room);
  if (dynamic_cast<const Error*>(&error) == nullptr)
    spdlog::warn("a message of the page has failed: {}", what);
  complain(id, what);
}

void Viewer::Impl::complain(ClientId id, const std::string& what) { say(id, "error", what); }
void Viewer::Impl::note(ClientId id, const std::string& what) { say(id, "note", what); }
void Viewer::Impl::say(ClientId id, const char* type, const std::string& what) {
  server.send_text(id, json_text(nlohmann::json{{"type", type}, {"text", what}}));
}

std::string Viewer::Impl::sentence(const std::exception& error, const char* no_room) {
  return dynamic_cast<const std::bad_alloc*>(&error) != nullptr ? no_room : error.what();
}

}  // namespace raysplats::view
