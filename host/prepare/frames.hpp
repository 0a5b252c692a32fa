// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace raysplats {

/// Whether a file is a photo by its extension.
bool is_photo(const std::filesystem::path& path);
/// Names of the photos in a folder, sorted. Throws DataError when it cannot be read.
std::vector<std::string> photos_in(const std::filesystem::path& folder);
/// Names of the photos in a folder and, as "folder/photo", in all folders below it but for hidden
/// ones, `without` and those that may not be read, sorted. Throws as photos_in().
std::vector<std::string> photos_below(const std::filesystem::path& folder,
                                      const std::filesystem::path& without = {});
/// Number of files by extension that are pictures of cameras and phones in formats that are not
/// read, with those in folders below as photos_below() takes them.
std::map<std::string, std::size_t> unread_pictures(const std::filesystem::path& folder, bool below);

/// Copies photos to a new folder.
void copy_photos(const std::filesystem::path& from,
                 const std::filesystem::path& to,
                 const std::vector<std::string>& names,
                 const std::function<void(std::size_t done)>& done);

/// What ffprobe says of a video.
struct VideoFacts {
  double seconds = 0;
  double rate = 0;          ///< frames a second on average; 0 = unknown
  double densest_rate = 0;  ///< where they follow each other fastest; 0 = unknown
  std::string transfer;     ///< ffmpeg's name of the curve of its brightness
};

/// Throws as run_program() when it is stopped, and DataError for a file that is no video and for
/// one of unknown length.
VideoFacts video_facts(const std::filesystem::path& video,
                       const std::filesystem::path& log,
                       const std::function<bool()>& stop);

/// Fills `images` with `count` sharp frames of a video, or with all it has, which a line of the log
/// says. Warns of HDR. Throws as run_program(), and DataError for a video without frames.
void take_frames(const std::filesystem::path& video,
                 const VideoFacts& facts,
                 const std::filesystem::path& images,
                 std::size_t count,
                 const std::filesystem::path& log,
                 const std::function<bool(std::size_t done, std::size_t total)>& watch);

}  // namespace raysplats
