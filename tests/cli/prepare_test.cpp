// SPDX-License-Identifier: Apache-2.0
// `prepare` of photos; of videos: prepare_video_test.cpp.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/trigonometric.hpp>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "../skip_test.hpp"
#include "io/dataset/colmap_model.hpp"
#include "prepare_stage.hpp"
#include "program.hpp"
#include "raysplats/io.hpp"
#include "scene/gaussians/gaussian_transform.hpp"
#include "util/file_lock.hpp"

namespace {

namespace fs = std::filesystem;

/// How far the poses of one model are from another's of the same photos.
struct Apart {
  std::size_t photos = 0;
  double mean_degrees = 0, most_degrees = 0;
  double mean_percent = 0,
         most_percent = 0;  ///< of centres, of the largest distance from their mean
};

/// After the similarity of which the rotation is the mean one of all photos.
Apart compare(const fs::path& found, const fs::path& stored) {
  std::map<std::string, raysplats::io::ColmapImage> theirs;
  for (const auto& image : raysplats::io::read_colmap_model(stored).images)
    theirs[image.name] = image;
  const auto ours = raysplats::io::read_colmap_model(found).images;
  const auto center = [](const auto& image) {
    return -(glm::transpose(image.rotation) * image.translation);
  };
  Apart out{ours.size()};
  const auto count = static_cast<double>(ours.size());
  glm::dmat3 sum(0.0);
  glm::dvec3 our_mean(0.0), their_mean(0.0);
  for (const auto& image : ours) {
    sum += glm::transpose(theirs.at(image.name).rotation) * image.rotation;
    our_mean += center(image) / count;
    their_mean += center(theirs.at(image.name)) / count;
  }
  const glm::dmat3 turn = raysplats::orthogonal_factor(sum);
  double our_size = 0, their_size = 0, extent = 0;
  for (const auto& image : ours) {
    const double away = glm::distance(center(theirs.at(image.name)), their_mean);
    extent = std::max(extent, away);
    their_size += away;
    our_size += glm::distance(center(image), our_mean);
  }
  for (const auto& image : ours) {
    const auto& other = theirs.at(image.name);
    const glm::dmat3 rest = other.rotation * turn * glm::transpose(image.rotation);
    const double cosine = 0.5 * (rest[0][0] + rest[1][1] + rest[2][2] - 1.0);
    const double degrees = glm::degrees(std::acos(std::clamp(cosine, -1.0, 1.0)));
    const glm::dvec3 moved =
        their_mean + their_size / our_size * (turn * (center(image) - our_mean));
    const double percent = 100.0 * glm::distance(moved, center(other)) / extent;
    out.mean_degrees += degrees / count;
    out.most_degrees = std::max(out.most_degrees, degrees);
    out.mean_percent += percent / count;
    out.most_percent = std::max(out.most_percent, percent);
  }
  return out;
}

}  // namespace

TEST_CASE("prepare makes a data set of photos and names those without a pose") {
  const Stage stage;
  const Outcome outcome = stage.run({stage.path("photos"), "-o", stage.path("data")});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(contains(outcome.out, "2 of 3 photos with poses and 1 point in"));
  CHECK(contains(outcome.err, "1 photo without a pose"));
  CHECK(contains(outcome.err, "c.png"));
  const std::string calls = stage.calls();
  CHECK(contains(calls, "feature_extractor"));
  CHECK(contains(calls, "--ImageReader.single_camera 1"));
  CHECK(contains(calls, "--SiftExtraction.max_num_features 8192"));
  CHECK(contains(outcome.err, "COLMAP will take about 0:0"));
  CHECK(contains(outcome.err, "for 3 photos"));
  CHECK(contains(calls, "exhaustive_matcher"));
  CHECK(contains(read_file(stage.path("data/prepare.log")), "Processed file [3/3]"));
  const Outcome info = raysplats_program({"info", stage.path("data")});
  INFO(info.err);
  CHECK(info.code == 0);
  CHECK(contains(info.out, "views            2"));

  // All is done: COLMAP is not called again, unless something has changed.
  const Outcome idle = stage.run({stage.path("photos"), "-o", stage.path("data")});
  CHECK(idle.code == 0);
  CHECK(stage.calls().empty());
  CHECK(!contains(idle.err, "COLMAP will take"));
  CHECK(stage.run({stage.path("photos"), "-o", stage.path("data"), "--matching", "sequential"})
            .code == 0);
  const std::string again = stage.calls();
  CHECK(!contains(again, "feature_extractor"));
  CHECK(contains(again, "sequential_matcher"));
  CHECK(contains(again, "mapper"));
}

TEST_CASE("prepare goes on after the last finished step") {
  const Stage stage;
  const Outcome failed = stage.run({stage.path("photos"), "-o", stage.path("data")}, "mapper");
  CHECK(failed.code == 1);
  CHECK(contains(failed.err, "colmap ended with exit code 7: "));
  CHECK(contains(failed.err, "the disk is on fire"));
  CHECK(contains(failed.err, "prepare.log"));
  CHECK(!fs::exists(stage.path("data/sparse")));
  stage.calls();
  CHECK(stage.run({stage.path("photos"), "-o", stage.path("data")}).code == 0);
  const std::string calls = stage.calls();
  CHECK(!contains(calls, "feature_extractor"));
  CHECK(!contains(calls, "matcher"));
  CHECK(contains(calls, "mapper"));
}

TEST_CASE("prepare leaves no poses of other photos beside those that it could not finish") {
  const Stage stage;
  const auto prepared = [&](const std::string& fail) {
    return stage.run({stage.path("photos"), "-o", stage.path("data")}, fail);
  };
  CHECK(prepared("").code == 0);
  const std::string former = read_file(stage.path("data/images/b.png"));
  // One that is none is told by its own name, and the data set stays as it was.
  raysplats::write_image(stage.path("photos/b.png"), raysplats::Image(16, 12, 3, 0.25f));
  write_file(stage.path("photos/c.png"), "no picture");
  check_refusal(prepared(""), 3, stage.path("photos/c.png"));
  CHECK(read_file(stage.path("data/images/b.png")) == former);
  CHECK(fs::exists(stage.path("data/sparse/0/images.txt")));
  fs::copy_file(stage.path("photos/a.png"), stage.path("photos/c.png"),
                fs::copy_options::overwrite_existing);
  stage.calls();
  CHECK(prepared("feature_extractor").code == 1);
  CHECK(read_file(stage.path("data/images/b.png")) == read_file(stage.path("photos/b.png")));
  CHECK(!fs::exists(stage.path("data/sparse")));
  for (const char* later : {"features", "matches", "model"})
    CHECK(!fs::exists(stage.path("data/prepare/" + std::string(later))));
  CHECK(prepared("").code == 0);
  CHECK(contains(stage.calls(), "mapper"));
  // Nor where somebody has taken a photo away from what was copied.
  fs::remove(stage.path("data/images/c.png"));
  CHECK(prepared("").code == 0);
  CHECK(fs::exists(stage.path("data/images/c.png")));
  CHECK(contains(stage.calls(), "feature_extractor"));
}

TEST_CASE("prepare knows the photos by any spelling, and keeps what others have become") {
  const Stage stage;
  const auto prepared = [&](const std::string& input) {
    Surroundings there;
    there.environment = {{"PATH", stage.path("bin") + ":/usr/bin:/bin"},
                         {"CALLS", stage.path("calls")}};
    there.folder = stage.path("");
    return raysplats_program({"prepare", input, "-o", "data"}, there);
  };
  CHECK(prepared("photos").code == 0);
  stage.calls();
  fs::create_directory_symlink("photos", stage.path("link"));
  const Words spellings{"photos/", "./photos", "photos/../photos",
                        "link",    "link/",    stage.path("photos/")};
  for (const std::string& spelling : spellings) {
    CAPTURE(spelling);
    CHECK(prepared(spelling).code == 0);
    CHECK(stage.calls().empty());
  }
  // As marks were written that name the folder as it was given.
  const std::string mark = stage.path("data/prepare/images");
  const std::string written = read_file(mark);
  write_file(mark, stage.path("./link/") + written.substr(written.find('\n')));
  CHECK(prepared("photos").code == 0);
  CHECK(stage.calls().empty());
  CHECK(contains(read_file(mark), "./link/\n"));

  fs::copy(stage.path("photos"), stage.path("other"));
  raysplats::write_image(stage.path("other/a.png"), raysplats::Image(16, 12, 3, 0.25f));
  const std::string photo = read_file(stage.path("data/images/a.png"));
  check_refusal(prepared("other"), 3, "data was made from " + stage.path("./link/"));
  CHECK(read_file(stage.path("data/images/a.png")) == photo);
  CHECK(stage.calls().empty());
}

TEST_CASE("two runs of prepare do not write to one folder") {
  const Stage stage;
  fs::create_directories(stage.path("data"));
  const raysplats::FileLock lock(stage.path("data/.lock"));
  check_refusal(stage.run({stage.path("photos"), "-o", stage.path("data")}), 3,
                "is in use by another run");
  CHECK(stage.calls().empty());
}

TEST_CASE("prepare says what is wrong with photos without poses, and sees a full disk") {
  const Stage stage;
  const std::vector<std::string> words{stage.path("photos"), "-o", stage.path("data")};
  const Outcome none = stage.run(words, "no model");
  CHECK(none.code == 3);
  CHECK(contains(none.err, "COLMAP found no poses for the 3 photos: they have to overlap"));
  CHECK(contains(none.err, "prepare.log"));
  for (const std::string step : {"feature_extractor", "exhaustive_matcher"}) {
    const Outcome full = stage.run({stage.path("photos"), "-o", stage.path(step)}, "full " + step);
    CHECK(full.code == 1);
    CHECK(contains(full.err, "database or disk is full"));
    stage.calls();
    CHECK(stage.run({stage.path("photos"), "-o", stage.path(step)}).code == 0);
    CHECK(contains(stage.calls(), step));
  }
}

TEST_CASE("prepare passes over folders that may not be read") {
  const Stage stage;
  fs::create_directories(stage.path("photos/lost+found"));
  raysplats::write_image(stage.path("photos/z/d.png"), raysplats::Image(8, 6, 3, 0.5f));
  fs::permissions(stage.path("photos/lost+found"), fs::perms::none);
  Surroundings there;
  there.environment = {{"PATH", stage.path("bin") + ":/usr/bin:/bin"},
                       {"CALLS", stage.path("calls")}};
  there.permissions_count = true;
  const Words words{"prepare", stage.path("photos"), "-o", stage.path("data")};
  const Outcome outcome = raysplats_program(words, there);
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  const Outcome below = raysplats_program(words + Words{"--subfolders"}, there);
  CHECK(below.code == 0);
  CHECK(contains(below.out, "of 4 photos"));
  fs::permissions(stage.path("photos"), fs::perms::none);
  const Outcome locked = raysplats_program(words, there);
  fs::permissions(stage.path("photos"), fs::perms::owner_all);
  fs::permissions(stage.path("photos/lost+found"), fs::perms::owner_all);
  check_refusal(locked, 3, "photos cannot be read");
}

TEST_CASE("prepare shares a camera among photos of one size") {
  const Stage stage;
  raysplats::write_image(stage.path("photos/d.png"), raysplats::Image(6, 8, 3, 0.5f));
  CHECK(stage.run({stage.path("photos"), "-o", stage.path("data")}).code == 0);
  const std::string calls = stage.calls();
  std::size_t extractors = 0;
  for (std::size_t at = 0; (at = calls.find("feature_extractor", at)) != std::string::npos; ++at)
    ++extractors;
  CHECK(extractors == 2);
  // The list of the last call: photos by their width.
  CHECK(read_file(stage.path("data/prepare/photos.txt")) == "a.png\nb.png\nc.png\n");

  CHECK(stage
            .run({stage.path("photos"), "-o", stage.path("data"), "--cameras", "photo",
                  "--features", "1000"})
            .code == 0);
  const std::string own = stage.calls();
  CHECK(own.find("feature_extractor") == own.rfind("feature_extractor"));
  CHECK(contains(own, "--ImageReader.single_camera 0"));
  CHECK(contains(own, "--SiftExtraction.max_num_features 1000"));
}

TEST_CASE("prepare takes photos of folders below where that is wished") {
  const Stage stage;
  for (const char* name : {"left/a.png", "left/deep/d.png", "right cam/b.png", ".trash/e.png"})
    raysplats::write_image(stage.path("photos/" + std::string(name)), raysplats::Image(8, 6, 3));
  const Outcome without = stage.run({stage.path("photos"), "-o", stage.path("data")});
  CHECK(without.code == 0);
  CHECK(contains(without.err,
                 "left out: left (1), left/deep (1), right cam (1); --subfolders takes"));
  CHECK(contains(without.out, "2 of 3 photos"));
  // What it has made lies below the photos, and is none of them.
  const std::string data = stage.path("photos/data");
  const auto with = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words{stage.path("photos"), "-o", data, "--subfolders"};
    words.insert(words.end(), more.begin(), more.end());
    return stage.run(words);
  };
  stage.calls();
  const Outcome outcome = with({});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(contains(outcome.out, "2 of 6 photos"));
  CHECK(read_file(data + "/prepare/photos.txt") ==
        "a.png\nb.png\nc.png\nleft/a.png\nleft/deep/d.png\nright cam/b.png\n");
  CHECK(fs::exists(data + "/images/right cam/b.png"));
  stage.calls();
  CHECK(with({}).code == 0);
  CHECK(stage.calls().empty());
  // A camera for each folder.
  CHECK(with({"--cameras", "folder"}).code == 0);
  const std::string calls = stage.calls();
  std::size_t extractors = 0;
  for (std::size_t at = 0; (at = calls.find("feature_extractor", at)) != std::string::npos; ++at)
    ++extractors;
  CHECK(extractors == 4);
  CHECK(contains(calls, "--ImageReader.single_camera 1"));
}

TEST_CASE("prepare finds the axis of a lens that has photos enough") {
  const Stage stage;
  for (int i = 0; i < 7; ++i) {
    raysplats::write_image(stage.path("photos/more_" + std::to_string(i) + ".png"),
                           raysplats::Image(8, 6, 3, 0.5f));
  }
  CHECK(stage.run({stage.path("photos"), "-o", stage.path("data")}).code == 0);
  CHECK(contains(stage.calls(), "--BundleAdjustment.refine_principal_point 1"));
  // A tenth photo of another camera does not do.
  fs::remove(stage.path("photos/more_6.png"));
  raysplats::write_image(stage.path("photos/tall.png"), raysplats::Image(6, 8, 3, 0.5f));
  CHECK(stage.run({stage.path("photos"), "-o", stage.path("data")}).code == 0);
  CHECK(!contains(stage.calls(), "bundle_adjuster"));
}

TEST_CASE("prepare calls the options of COLMAP by the names that its version has") {
  for (const char* of_size : {"--FeatureExtraction", "--SiftExtraction"}) {
    const Stage stage;
    const std::string max_size = std::string(of_size) + ".max_image_size";
    stage.write_newer_colmap("--FeatureExtraction.use_gpu " + max_size +
                             " --SiftExtraction.max_num_features --FeatureMatching.use_gpu");
    const Outcome outcome = stage.run({stage.path("photos"), "-o", stage.path("data")});
    INFO(outcome.err);
    CHECK(outcome.code == 0);
    const std::string calls = stage.calls();
    CHECK(contains(calls, "--FeatureExtraction.use_gpu 0"));
    CHECK(contains(calls, max_size + " 1600"));
    CHECK(contains(calls, "--FeatureMatching.use_gpu 0"));
    CHECK(contains(outcome.err, "] 1/1"));  // pairs
    CHECK(contains(outcome.err, "] 2/3"));  // poses
  }
  // Where its help says nothing of them, the names are the old ones.
  const Stage stage;
  CHECK(stage.run({stage.path("photos"), "-o", stage.path("data")}).code == 0);
  const std::string calls = stage.calls();
  CHECK(contains(calls, "--SiftExtraction.use_gpu 0 --SiftExtraction.max_image_size 1600"));
  CHECK(contains(calls, "--SiftMatching.use_gpu 0"));
}

TEST_CASE("prepare sees that a photo or a video has become another") {
  const Stage stage;
  const auto later = [&](const std::string& name) {
    fs::last_write_time(stage.path(name),
                        fs::last_write_time(stage.path(name)) + std::chrono::hours(1));
  };
  stage.write_video("12.5", "");
  for (const auto& [input, data, changed] :
       {std::array{"photos", "data", "photos/b.png"}, std::array{"walk.mp4", "walk", "walk.mp4"}}) {
    const std::vector<std::string> words{stage.path(input), "-o", stage.path(data), "--frames",
                                         "3"};
    CHECK(stage.run(words).code == 0);
    CHECK(!stage.calls().empty());
    CHECK(stage.run(words).code == 0);
    CHECK(stage.calls().empty());
    later(changed);
    CHECK(stage.run(words).code == 0);
    CHECK(contains(stage.calls(), "feature_extractor"));
  }
  write_file(stage.path("walk.mp4"), "a longer video");
  CHECK(stage.run({stage.path("walk.mp4"), "-o", stage.path("walk"), "--frames", "3"}).code == 0);
  CHECK(contains(stage.calls(), "fps="));
}

TEST_CASE("prepare takes the frames of a video anew where one of them is missing") {
  const Stage stage;
  stage.write_video("12.5", "");
  // Repeated frames are left out.
  for (const char* name : {"1", "4", "7"}) {
    raysplats::write_image(stage.path("frame" + std::string(name) + ".jpg"),
                           raysplats::Image(8, 6, 3, static_cast<float>(name[0] - '0') / 10.0f));
  }
  stage.write("bin/ffmpeg",
              "#!/bin/sh\necho \"$@\" >> \"$CALLS\"\nfor last; do :; done\nfor i in 1 4 7; do "
              "cp '" +
                  stage.path("frame") +
                  "'$i.jpg \"$(dirname \"$last\")/frame_00000$i.jpg\"; "
                  "done\n");
  const auto prepared = [&] {
    return stage.run({stage.path("walk.mp4"), "-o", stage.path("data"), "--frames", "3"});
  };
  CHECK(prepared().code == 0);
  REQUIRE(entries(stage.path("data/images")) == 3);
  stage.calls();
  CHECK(prepared().code == 0);
  CHECK(stage.calls().empty());
  // As older versions left it.
  fs::remove(stage.path("data/prepare/frames"));
  CHECK(prepared().code == 0);
  CHECK(stage.calls().empty());
  const fs::path images = stage.path("data/images");
  fs::remove(fs::directory_iterator(images)->path());
  CHECK(prepared().code == 0);
  CHECK(contains(stage.calls(), "feature_extractor"));
  CHECK(entries(images.string()) == 3);
  fs::remove_all(images);
  const Outcome outcome = prepared();
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  CHECK(contains(outcome.out, " of 3 photos with poses"));
  CHECK(entries(images.string()) == 3);
}

TEST_CASE("prepare says which of many photos it compares, and which pictures it leaves out") {
  const Stage stage;
  for (int i = 0; i < 398; ++i) {
    fs::copy_file(stage.path("photos/a.png"),
                  stage.path("photos/more_" + std::to_string(i) + ".png"));
  }
  write_file(stage.path("photos/IMG_1.HEIC"), "?");
  const auto prepared = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words{stage.path("photos"), "-o", stage.path("data")};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = stage.run(words);
    INFO(outcome.err);
    CHECK(outcome.code == 0);
    return outcome.err;
  };
  const std::string told = prepared({});
  CHECK(
      contains(told, "more than 400 photos: each is compared with the 12 that follow it by name"));
  CHECK(contains(told, "--matching exhaustive"));
  CHECK(contains(told, "left out: 1 .heic; convert"));
  CHECK(contains(stage.calls(), "sequential_matcher"));
  // Where nothing is compared, and where somebody has chosen, nothing is said.
  CHECK(!contains(prepared({}), "more than 400"));
  CHECK(!contains(prepared({"--matching", "exhaustive"}), "more than 400"));
  CHECK(contains(stage.calls(), "exhaustive_matcher"));
}

TEST_CASE("prepare says in one sentence what is missing") {
  const Stage stage;
  Surroundings without;
  without.environment = {{"PATH", stage.path("empty")}};
  check_refusal(
      raysplats_program({"prepare", stage.path("photos"), "-o", stage.path("data")}, without), 2,
      "apt-get install colmap");
  CHECK(!fs::exists(stage.path("data")));
  check_refusal(stage.run({stage.path("nothing"), "-o", stage.path("data")}), 3, "does not exist");
  fs::create_directories(stage.path("few"));
  check_refusal(stage.run({stage.path("few"), "-o", stage.path("data")}), 3, "0 photos");
  // Photos in folders below may be the same at other sizes: none is taken unasked.
  fs::copy(stage.path("photos"), stage.path("few/camera 1"));
  const Outcome below = stage.run({stage.path("few"), "-o", stage.path("data")});
  check_refusal(below, 3, "camera 1 (3): name one of them, or take all with --subfolders");
  CHECK(!fs::exists(stage.path("data")));
  // What phones and cameras write, and nothing here reads.
  for (const char* name : {"IMG_1.HEIC", "IMG_2.heic", "IMG_3.dng", "a.txt"})
    write_file(stage.path("phone/" + std::string(name)), "?");
  check_refusal(stage.run({stage.path("phone"), "-o", stage.path("data")}), 3,
                "(1 .dng, 2 .heic): convert them to JPEG");
  CHECK(!fs::exists(stage.path("data")));
  const Outcome nowhere = stage.run({stage.path("photos"), "-o", "/proc/raysplats"});
  check_refusal(nowhere, 3, "The output folder /proc/raysplats cannot be created");
  CHECK(!contains(nowhere.err, "filesystem error"));
  // A photo is no video, nor is what ffprobe does not know or finds no pictures in.
  check_refusal(stage.run({stage.path("photos/a.png"), "-o", stage.path("data")}), 3,
                "a.png is a photo: name its folder");
  CHECK(!fs::exists(stage.path("data")));
  stage.write_video("12.5", "", "");
  const std::vector<std::string> video{stage.path("walk.mp4"), "-o", stage.path("no video")};
  const Outcome sound = stage.run(video);
  CHECK(sound.code == 3);
  CHECK(contains(sound.err, "walk.mp4 is no video that ffmpeg can read"));
  stage.write("bin/ffprobe", "#!/bin/sh\necho 'Invalid data found'\nexit 1\n");
  const Outcome text = stage.run(video);
  CHECK(text.code == 3);
  CHECK(contains(text.err, "walk.mp4 is no video that ffmpeg can read: "));
  CHECK(contains(text.err, "Invalid data found"));
  // Images of somebody else are not touched.
  write_file(stage.path("mine/images/x.png"), "mine");
  check_refusal(stage.run({stage.path("photos"), "-o", stage.path("mine")}), 3, "another folder");
  CHECK(read_file(stage.path("mine/images/x.png")) == "mine");
  // Nor models and data sets of somebody else, runs, and the photos.
  for (const std::string file : {"sparse/0/cameras.txt", "database.db", "transforms_train.json",
                                 "point_cloud/iteration_1/point_cloud.ply"}) {
    CAPTURE(file);
    const std::string folder = stage.path("of " + file.substr(0, 5));
    write_file(folder + "/" + file, "mine");
    const Outcome outcome = stage.run({stage.path("photos"), "-o", folder});
    INFO(outcome.err);
    CHECK(outcome.code != 0);
    CHECK(one_sentence(outcome));
    CHECK(contains(outcome.err, "another"));
    CHECK(read_file(folder + "/" + file) == "mine");
    CHECK(!fs::exists(folder + "/prepare"));
  }
  check_refusal(stage.run({stage.path("photos"), "-o", stage.path("photos")}), 2,
                "is what is read");
  CHECK(entries(stage.path("photos")) == 3);
}

// RAYSPLATS_TEST_DATA as in tests/unit/io/dataset/real_data_test.cpp. COLMAP takes minutes for the
// photos.
TEST_CASE("the real COLMAP finds the poses of a capture, where both are there") {
  const char* data = std::getenv("RAYSPLATS_TEST_DATA");
  SKIP_TEST_UNLESS(data != nullptr && std::system("command -v colmap > /dev/null") == 0,
                   "RAYSPLATS_TEST_DATA is not set, or there is no colmap");
  const fs::path capture = fs::path(data) / "colmap/fox_undistorted";
  const TemporaryFolder folder;
  const Outcome outcome =
      raysplats_program({"prepare", (capture / "images").string(), "-o", folder / "data", "-q"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  const Apart apart = compare(folder / "data/sparse/0", capture / "sparse/0");
  MESSAGE(apart.photos << " photos: rotations " << apart.mean_degrees << " degrees apart, at most "
                       << apart.most_degrees << "; centres " << apart.mean_percent
                       << " % of the extent, at most " << apart.most_percent);
  CHECK(apart.photos == 50);
  CHECK(apart.mean_degrees < 0.3);
  CHECK(apart.most_degrees < 0.6);
  CHECK(apart.mean_percent < 0.5);
  CHECK(apart.most_percent < 1.0);
}
