// SPDX-License-Identifier: Apache-2.0
#include "run/run_folder.hpp"
#include "unit/temporary_directory.hpp"

#include <doctest/doctest.h>

#include <clocale>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "util/atomic_file.hpp"

using namespace raysplats;

namespace {

EvaluationRow row(std::int64_t iteration, double psnr, std::size_t views) {
  EvaluationRow out;
  out.iteration = iteration;
  out.psnr = psnr;
  out.views = views;
  return out;
}

}  // namespace

TEST_CASE("a run that ends below its best evaluation is told, unless that saw other views") {
  CHECK_FALSE(better_before(std::vector<EvaluationRow>{}).has_value());
  CHECK_FALSE(better_before(std::vector{row(10, 20, 3)}).has_value());
  CHECK_FALSE(better_before(std::vector{row(10, 20.05, 3), row(20, 20, 3)}).has_value());
  CHECK_FALSE(better_before(std::vector{row(10, 25, 2), row(20, 20, 3)}).has_value());
  const auto best = better_before(std::vector{row(5, 21, 3), row(10, 23, 3), row(20, 20, 3)});
  REQUIRE(best.has_value());
  CHECK(best->iteration == 10);
}

TEST_CASE("a run is told of what it was judged by") {
  // With exposures by corrected colours: plain ones fall while those rise.
  EvaluationRow before = row(10, 23, 3), last = row(20, 20, 3);
  before.psnr_corrected = 24;
  last.psnr_corrected = 25;
  CHECK_FALSE(better_before(std::vector{before, last}, true).has_value());
  CHECK(better_before(std::vector{before, last}, false).has_value());
  last.psnr_corrected = 23;
  REQUIRE(better_before(std::vector{before, last}, true).has_value());
  CHECK(judged_psnr(before, true) == 24);
  // Where cameras were moved they count, and what was measured without cannot be compared.
  last.psnr_aligned = 30;
  CHECK(judged_psnr(last, true) == 30);
  CHECK_FALSE(better_before(std::vector{before, last}, false).has_value());
  before.psnr_aligned = 31;
  CHECK(better_before(std::vector{before, last}, false).has_value());
}

TEST_CASE("an evaluation takes the place of one of the same iteration") {
  const TemporaryDirectory folder;
  RunFolder run(folder.path());
  run.record(row(10, 20, 1));
  run.record(row(20, 21, 1));
  run.record(row(20, 22, 3));
  REQUIRE(run.evaluations().size() == 2);
  CHECK(run.evaluations().back().views == 3);
}

TEST_CASE("a folder knows its newest model, and what a run that goes on has said") {
  const TemporaryDirectory folder;
  RunFolder run(folder.path());
  CHECK_FALSE(run.newest_model().has_value());
  for (const char* name : {"iteration_9", "iteration_30"})
    folder.write(std::string("point_cloud/") + name + "/point_cloud.ply", "ply");
  std::filesystem::create_directories(folder / "point_cloud/iteration_50");  // empty
  CHECK(run.newest_model() == 30);

  folder.write("metrics.csv",
               "iteration,seconds,loss,psnr,gaussians,it_per_s,candidates,hits\n"
               "10,1.5,0.5,12,100,7,1,2\n20,3,0.25,13.5,100,7,1,2\n30,4,0.125,14,100,7,1,2\n");
  folder.write("metrics.json", R"({"command":"first","evaluations":[]})");
  run.begin_metrics(20);
  REQUIRE(run.former_rows().size() == 2);
  CHECK(run.former_rows().back().iteration == 20);
  CHECK(run.former_rows().back().loss == 0.25);
  CHECK(run.former_rows().back().psnr == 13.5);
  CHECK(run.former_metrics()->at("command") == "first");
  run.begin_metrics(0);
  CHECK(run.former_rows().empty());
  CHECK(run.former_metrics()->is_null());
}

TEST_CASE("the model of a run that diverged is kept, and its whole Gaussians can be read") {
  const TemporaryDirectory folder;
  Gaussians model;
  model.resize(3);
  model.means = {0, 1, 2, 3, 4, 5, 6, 7, 8};
  model.opacities[1] = std::numeric_limits<float>::quiet_NaN();
  const RunFolder run(folder.path());
  run.write_model(model, TraceOptions{}, 7);
  const std::filesystem::path file = folder / "point_cloud/iteration_7/point_cloud.ply";
  CHECK(run.newest_model() == 7);
  CHECK_THROWS_AS(read_ply(file), DataError);
  CHECK(read_ply(file, true).means == std::vector<float>{0, 1, 2, 6, 7, 8});
  CHECK_THROWS_AS(write_ply(folder / "a.ply", model), DataError);
}

TEST_CASE("rows of an older metrics.csv stay when its run goes on") {
  const TemporaryDirectory folder;
  // Without the two columns that came later; the third row was cut off.
  std::ofstream(folder / "metrics.csv") << "iteration,seconds,loss,psnr,gaussians,it_per_s\n10,1.5,"
                                           "0.5,12,100,7\n20,3,0.4,13,100,7\n30,4";
  RunFolder run(folder.path());
  run.begin_metrics(30);
  std::ifstream stream(folder / "metrics.csv");
  const std::string text(std::istreambuf_iterator<char>(stream), {});
  CHECK(text ==
        "iteration,seconds,loss,psnr,gaussians,it_per_s,candidates,hits\n10,1.5,0.5,12,100,7,0,0\n"
        "20,3,0.4,13,100,7,0,0\n");
}

TEST_CASE("a run that starts leaves the files alone that others write into its folder") {
  const TemporaryDirectory folder;
  AtomicFile picture(folder / "turn.gif");
  picture.write("frames");
  const FileLock lock = RunFolder(folder.path()).lock();
  picture.commit();
  CHECK(read_bytes(folder / "turn.gif") == "frames");
}

TEST_CASE("columns of a run are read alike where decimals have a comma") {
  const char* before = std::setlocale(LC_NUMERIC, nullptr);
  const std::string usual = before == nullptr ? "C" : before;
  if (std::setlocale(LC_NUMERIC, "de_DE.UTF-8") == nullptr) {
    MESSAGE("the locale de_DE.UTF-8 is not installed");
    return;
  }
  const TemporaryDirectory folder;
  folder.write("metrics.csv", "iteration,seconds,loss,psnr\n10,7.25,0.5,20.75\n");
  RunFolder run(folder.path());
  run.begin_metrics(10);
  std::setlocale(LC_NUMERIC, usual.c_str());
  REQUIRE(run.former_rows().size() == 1);
  CHECK(run.former_rows()[0].seconds == 7.25);
  CHECK(run.former_rows()[0].loss == 0.5);
  CHECK(run.former_rows()[0].psnr == 20.75);
}

TEST_CASE("masks of what moves lie as their photos do, and go with the run, alone") {
  const TemporaryDirectory folder;
  const std::filesystem::path path = folder / "run", moving = path / "moving";
  const RunFolder run(path);
  const Image mask(4, 3, 1);
  for (const char* photo : {"left/01.jpg", "right/01.jpg", "02.jpg", "../../03.jpg"})
    run.write_moving(photo, mask);
  for (const char* file : {"left/01.jpg.png", "right/01.jpg.png", "02.jpg.png", "03.jpg.png"})
    CHECK(std::filesystem::is_regular_file(moving / file));
  std::ofstream(moving / "left" / "notes.txt") << "mine";
  run.remove_after(0);
  CHECK(std::filesystem::exists(moving / "left" / "notes.txt"));
  CHECK_FALSE(std::filesystem::exists(moving / "left" / "01.jpg.png"));
  CHECK_FALSE(std::filesystem::exists(moving / "right"));
  CHECK_FALSE(std::filesystem::exists(moving / "02.jpg.png"));
  std::filesystem::remove(moving / "left" / "notes.txt");
  run.remove_moving();
  CHECK_FALSE(std::filesystem::exists(moving));
}
