// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "raysplats/image.hpp"
#include "view/mesh_queue.hpp"
#include "view/mesh_uploads.hpp"
#include "view/pace.hpp"
#include "view/picture_source.hpp"
#include "view/server.hpp"
#include "view/view_request.hpp"
#include "view/viewer.hpp"

namespace raysplats::view {

using Clock = std::chrono::steady_clock;

/// A sample that is to be drawn.
struct Order {
  ViewRequest request;
  std::optional<Pace> pace;  ///< where its size is chosen by time
  std::uint64_t wish = 0;
  std::uint64_t sample = 0;
};

/// One page.
struct Client {
  std::optional<ViewRequest> wanted;  ///< its newest wish
  std::uint64_t wish = 0;             ///< counts the wishes
  std::uint64_t drawn = 0;            ///< samples of `sum`, of the wish in work
  Image sum;
  Pace pace{0.0};          ///< of movements
  Pace rest{0.0};          ///< of pictures in a hurry
  std::uint64_t turn = 0;  ///< when it was served last
  bool fresh = false;      ///< nothing has been tried of `wanted`
  Clock::time_point due;   ///< of its next wish

  bool ready(Clock::time_point now) const { return !fresh || now >= due; }
};

// The pages that are open and what they wait for. Its functions stand in files by what they are
// for.
struct Viewer::Impl {
  explicit Impl(const ViewerOptions& options_in);

  // viewer_messages.cpp: what pages ask for and say.
  HttpReply get(std::string_view path) const;
  HttpReply found(std::string_view path) const;
  HttpReply photo(std::string_view number) const;
  void opened(ClientId id);
  void closed(ClientId id);
  void heard(ClientId id, std::string_view text);
  void received(ClientId id, std::span<const std::byte> bytes);
  static MeshMessage about_mesh(const Message& message);
  /// A page's message has failed. What is not its own fault is said here as well.
  void excuse(ClientId id, const std::exception& error, const char* no_room);
  void complain(ClientId id, const std::string& what);
  void note(ClientId id, const std::string& what);
  void say(ClientId id, const char* type, const std::string& what);
  /// What went wrong, for people; `no_room` where it was memory.
  static std::string sentence(const std::exception& error, const char* no_room);

  // viewer_schedule.cpp: what is done next, with the mutex held; `most` is the samples of a picture
  // that the source can draw.
  /// The page that has waited longest, those that move first; nothing when all have what they want.
  std::optional<ClientId> next(std::uint64_t most, Clock::time_point now) const;
  /// A page whose question may be answered.
  std::optional<ClientId> next_pick(Clock::time_point now) const;
  bool has_work(std::uint64_t most, Clock::time_point now) const;
  /// When the next wish that has to wait may be seen to.
  Clock::time_point next_due(Clock::time_point now) const;
  std::uint64_t samples_of(const ViewRequest& request, std::uint64_t most) const;

  // viewer.cpp: the work itself.
  void answer(PictureSource& source, ClientId id, const PickRequest& pick);
  void obey(ClientId id, MeshMessage message);
  /// The page's wish cannot be drawn: it is told why, and nothing is tried until it wishes again.
  void give_up(ClientId id, std::uint64_t wish, const std::exception& error);
  void tell(const std::string& json);
  void refresh();
  void draw(PictureSource& source,
            std::int64_t iteration,
            ClientId id,
            const std::function<bool()>& stop);
  /// Draws the next sample of what was ordered and sends what there is of it.
  void deliver(PictureSource& source,
               std::int64_t iteration,
               ClientId id,
               Order& order,
               const std::function<bool()>& stop);

  static constexpr std::size_t kMostWaiting = 16;
  static constexpr const char* kNoRoomForPicture =
      "There is not enough memory for the picture: make the window smaller";
  static constexpr const char* kNoRoomForMesh =
      "There is not enough memory for that mesh: simplify it first";
  static constexpr const char* kNoRoom =
      "There is not enough memory: close other programs and try again";

  ViewerOptions options;
  mutable std::mutex mutex;
  std::condition_variable news;
  std::map<ClientId, Client> clients;
  std::map<ClientId, PickRequest> picks;  ///< the newest of each page
  std::deque<RunCommand> commands;
  MeshUploads uploads;
  MeshQueue about_meshes;
  std::uint64_t wishes = 0;
  std::uint64_t turns = 0;
  double hurry = 0.0;  ///< seconds for a picture of a page that rests; 0 = as long as it takes
  std::optional<Clock::time_point> last_motion;
  std::string last_trouble;  ///< of give_up()
  std::function<void(RunCommand)> on_command;
  Server server;  // last: its thread uses all of the above
};

}  // namespace raysplats::view
