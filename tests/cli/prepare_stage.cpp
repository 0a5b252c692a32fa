// SPDX-License-Identifier: Apache-2.0
#include "prepare_stage.hpp"

#include <filesystem>

#include "raysplats/io.hpp"

namespace fs = std::filesystem;

namespace {

/// Places a.png and b.png, but not c.png. Says nothing of its options. $FAIL as in
/// Stage::run().
constexpr const char* kColmap = R"sh(#!/bin/sh
case "$*" in *" -h") exit 0 ;; esac
echo "$@" >> "$CALLS"
[ -n "$FAIL" ] && [ "$1" = "$FAIL" ] && { echo "the disk is on fire"; exit 7; }
[ "full $1" = "$FAIL" ] && echo "SQLite error [database.cc, line 9]: database or disk is full" >&2
case $1 in
feature_extractor) echo "Processed file [1/3]"; echo "Processed file [3/3]" ;;
mapper)
  [ "$FAIL" = "no model" ] && { echo "ERROR: failed to create sparse model"; exit 1; }
  while [ "$1" != --output_path ]; do shift; done
  mkdir -p "$2/0"
  echo "Registering image #1 (1)"
  printf '1 PINHOLE 8 6 10 10 4 3\n' > "$2/0/cameras.txt"
  printf '1 1 0 0 0 0 0 4 1 a.png\n\n2 1 0 0 0 0.1 0 4 1 b.png\n\n' > "$2/0/images.txt"
  printf '1 0 0 0 255 0 0 0.5 1 0 2 0\n' > "$2/0/points3D.txt" ;;
esac
)sh";

/// Knows of Sift* and Feature* the words of $options only, and writes as newer versions do: the
/// newest end with an error after the help. The rest of the work is bin/colmap3's.
constexpr const char* kNewerColmap = R"sh(
log="I20260221 20:49:56.229118 18720 a.cc:1]"
case "$*" in
*" -h") echo "$log Options can be specified"; printf '  %s arg (=1)\n' $options; exit 1 ;;
esac
for word; do
  case $word in
  --Sift* | --Feature*)
    case " $options " in
    *" $word "*) ;;
    *) echo "$log Failed to parse options - unrecognised option '$word'."; exit 1 ;;
    esac ;;
  esac
done
case $1 in
exhaustive_matcher) echo "$log Processing block [1/1, 1/1]" ;;
mapper) echo "$log Registering image #7 (num_reg_frames=2)" ;;
esac
exec "$(dirname "$0")/colmap3" "$@"
)sh";

}  // namespace

Stage::Stage() {
  write("bin/colmap", kColmap);
  for (const char* name : {"a.png", "b.png", "c.png"}) {
    raysplats::write_image(folder_ / ("photos/" + std::string(name)),
                           raysplats::Image(8, 6, 3, 0.5f));
  }
}

void Stage::write(const std::string& name, const std::string& text) const {
  write_file(folder_ / name, text);
  fs::permissions(folder_ / name, fs::perms::owner_all);
}

void Stage::write_newer_colmap(const std::string& options) const {
  write("bin/colmap3", kColmap);
  write("bin/colmap", "#!/bin/sh\noptions='" + options + "'\n" + kNewerColmap);
}

void Stage::write_video(const std::string& length,
                        const std::string& packets,
                        const std::string& stream) const {
  write_file(path("walk.mp4"), "a video");
  write("bin/ffprobe", "#!/bin/sh\ncase \"$*\" in\n*format=duration*) printf '" + stream +
                           "duration=" + length + "\\n' ;;\n*) printf '" + packets +
                           "' ;;\nesac\n");
  raysplats::write_image(path("flat.jpg"), raysplats::Image(8, 6, 3, 0.5f));
  write("bin/ffmpeg",
        "#!/bin/sh\necho \"$@\" >> \"$CALLS\"\nfor last; do :; done\n"
        "for i in 1 4 7; do cp '" +
            path("flat.jpg") + "' \"$(dirname \"$last\")/frame_00000$i.jpg\"; done\n");
}

Outcome Stage::run(const Words& arguments, const std::string& fail) const {
  std::vector<std::string> words{"prepare"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  Surroundings there;
  there.environment = {
      {"PATH", path("bin") + ":/usr/bin:/bin"}, {"CALLS", path("calls")}, {"FAIL", fail}};
  return raysplats_program(words, there);
}

std::string Stage::calls() const {
  std::string text = fs::exists(path("calls")) ? read_file(path("calls")) : "";
  fs::remove(path("calls"));
  return text;
}
