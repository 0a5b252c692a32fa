// SPDX-License-Identifier: Apache-2.0
// What the report of a run warns of.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <cmath>
#include <glm/trigonometric.hpp>
#include <numbers>
#include <string>
#include <utility>

#include "report/run_report.hpp"
#include "unit/report/written_run.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using test::contains;
using test::Run;

TEST_CASE("the end of a run is compared with evaluations of as many views") {
  const Run run;
  const auto page_of = [&](const std::string& evaluations) {
    run.write("metrics.json",
              R"({"complete":true,"psnr_rise":null,"seed":18446744073709551615,"evaluations":[)" +
                  evaluations + "]}");
    return run_report(run.path());
  };
  // The two views of --eval-views 2 are easier than the nine of the end.
  const std::string easy = R"({"iteration":100,"psnr":25,"views":2},)";
  const std::string page = page_of(easy + R"({"iteration":200,"psnr":21,"views":9})");
  CHECK(!contains(page, "below its best"));
  CHECK(contains(page, "Complete: 21.0 dB on 9 held-out views, nothing to warn of."));
  CHECK(contains(page, "<td>18446744073709551615</td>"));
  CHECK(contains(page_of(easy + R"({"iteration":150,"psnr":22,"views":9},
                              {"iteration":200,"psnr":21.5,"views":9})"),
                 "ends 0.50 dB below its best, at iteration 150"));
}

TEST_CASE("views that stand out, a full model and blurred photos are warned of") {
  const Run run;
  CHECK(!contains(run_report(run.path()), "far worse"));  // three views tell nothing
  std::string images;
  for (int i = 0; i < 12; ++i) {
    images += i == 0 ? "" : ",";
    images += R"({"name":")" + std::to_string(i) + R"(_.png","psnr":)" +
              std::to_string(i == 3 ? 12 : 20 + i % 5) + R"(,"sharpness":)" +
              std::to_string(i == 7 ? 0.001 : 0.05 + 0.01 * (i % 3)) + "}";
  }
  run.write("eval/iteration_200/metrics.json", R"({"images":[)" + images + "]}");
  run.write("metrics.json", R"({"complete":true,"gaussians":140,"most_gaussians":141,
    "evaluations":[{"iteration":200,"psnr":20}]})");
  const std::string page = run_report(run.path());
  CHECK(contains(page, "pose or photo may be wrong, or few photos show that part: 3_.png."));
  CHECK(contains(page, "Held-out photos less sharp than the others: 7_.png."));
  CHECK(!contains(page, "Training photos"));
  CHECK(contains(page, "<td>140, at most 141</td>"));
  CHECK(!contains(page, "stopped at its limit"));  // where the budget strategy always ends
  run.write("config.toml", "strategy = \"adc\"\n");
  CHECK(contains(run_report(run.path()), "stopped at its limit of 141"));
  // The same of photos to train with, which metrics.json itself has.
  const std::string settled = R"({"complete":true,"iteration":300,"photos":[)";
  run.write("metrics.json", settled + images + "]}");
  const std::string trained = run_report(run.path());
  CHECK(contains(trained,
                 "Training photos less sharp than the others, which blur the model: 7_.png."));
  CHECK(contains(trained, "or something in them has moved: 3_.png."));
  // What the run has not seen at full size says nothing, and is no odd one.
  std::string seen = images;
  for (int i = 0; i < 6; ++i) seen += R"(,{"name":"unseen.png","sharpness":0.05})";
  run.write("metrics.json", settled + seen + "]}");
  CHECK(contains(run_report(run.path()), "or something in them has moved: 3_.png."));
  // At the border of a capture the photos beside it are as far off.
  std::string border = seen;
  for (const char* psnr : {"12.5", "13"})
    border += R"(,{"name":"beside.png","sharpness":0.05,"psnr":)" + std::string(psnr) +
              R"(,"center":[9,0,0]})";
  border += R"(,{"name":"corner.png","sharpness":0.05,"psnr":11,"center":[9,0,0]})";
  run.write("metrics.json", settled + border + "]}");
  const std::string corner = run_report(run.path());
  CHECK(!contains(corner, "corner.png"));
  CHECK(contains(corner, "or something in them has moved: 3_.png."));
}

TEST_CASE("a run that has seen its photos a few times warns of those alone that stand out far") {
  const Run run;
  const auto is_odd = [&](double psnr, int iterations, int photos = 20) {
    std::string list;
    for (int i = 0; i < photos; ++i)
      list += fmt::format(R"({}{{"name":"{}.png","psnr":{}}})", i > 0 ? "," : "", i,
                          i == 3 ? psnr : 25 + i % 5);
    run.write("metrics.json",
              fmt::format(R"({{"complete":true,"iteration":{},"photos":[{}]}})", iterations, list));
    return contains(run_report(run.path()), "or something in them has moved: 3.png.");
  };
  CHECK(is_odd(20, 200));
  CHECK_FALSE(is_odd(20, 199));
  CHECK(is_odd(10, 100));
  // Of few photos each shows what no other does.
  CHECK_FALSE(is_odd(15, 3000, 11));
  // Of many photos few steps for each make a model.
  CHECK(is_odd(20, 3000, 400));
  CHECK_FALSE(is_odd(20, 2999, 400));
  run.write("config.toml", "views-per-step = 2\n");
  CHECK(is_odd(20, 100));
}

TEST_CASE("a run warns of photos that contradict those from beside them where they are many") {
  const Run run;
  // Two walks around an object, the second of which sees it from `turned` degrees aside.
  const auto warns = [&](double psnr, double turned, int wrong) {
    std::string list;
    for (int i = 0; i < 60; ++i) {
      const bool second = i >= 30;
      const double angle = 2 * std::numbers::pi * (i % 30) / 30;
      const double to = angle + (second ? glm::radians(turned) : 0.0);
      list += fmt::format(
          R"({}{{"name":"{}.png","psnr":{},"center":[{},{},{}],"direction":[{},{},0]}})",
          i > 0 ? "," : "", i, second && i < 30 + wrong ? psnr : 30 + i % 3, -std::cos(angle),
          -std::sin(angle), second ? 0.5 : 0.0, std::cos(to), std::sin(to));
    }
    run.write("metrics.json",
              fmt::format(R"({{"complete":true,"iteration":600,"photos":[{}]}})", list));
    return contains(run_report(run.path()),
                    "find the poses anew, or remove these and the like: 30.png, 31.png, "
                    "32.png, ");
  };
  CHECK(warns(21, 0, 12));
  CHECK_FALSE(warns(24, 0, 12));
  // A few are no part of a capture, and who looks elsewhere contradicts nobody.
  CHECK_FALSE(warns(21, 0, 6));
  CHECK_FALSE(warns(21, 90, 12));
}

TEST_CASE("a run names the photos that it left out, which are no odd ones of its end") {
  const Run run;
  std::string list;
  for (int i = 0; i < 20; ++i) {
    list += fmt::format(R"({}{{"name":"{}.png","psnr":{}{}}})", i > 0 ? "," : "", i,
                        i == 3 ? 12 : 25 + i % 5, i == 3 ? R"(,"left_out_from":300)" : "");
  }
  run.write("metrics.json",
            fmt::format(R"({{"complete":true,"iteration":600,"photos":[{}]}})", list));
  const std::string page = run_report(run.path());
  CHECK(contains(page, "Training photos that were left out, because they contradict others"));
  CHECK(contains(page, "or something in them has moved: 3.png."));
  CHECK(!contains(page, "comes far less near to"));
}

TEST_CASE("a run warns of what it has found in its capture before its first step") {
  const Run run;
  const auto page_of = [&](const char* warnings) {
    run.write("metrics.json", fmt::format(R"({{"complete":true,"iteration":600,"photo_warnings":{},
      "camera_warnings":["all others stand there"]}})",
                                          warnings));
    return run_report(run.path());
  };
  const std::string page = page_of(R"(["something stands <still>","2 of 9 are grey"])");
  CHECK(contains(page, "Something stands &lt;still&gt;."));
  CHECK(contains(page, "2 of 9 are grey."));
  CHECK(contains(page, "All others stand there."));
  CHECK(contains(page, "3 warnings"));
  for (const char* damaged : {"[]", "[1,null,\"\",{}]", "{}", "7", "\"text\""})
    CHECK(contains(page_of(damaged), "1 warning"));
}

TEST_CASE("a run whose held-out photos fit where they are shifted names --poses") {
  const Run run;
  const auto names_poses = [&](double gain, int iteration, const std::string& poses,
                               double other = 0) {
    std::string images;
    for (const double pixels : {0.5, 1.2, 2.0}) {
      images += fmt::format(R"({}{{"psnr":24,"psnr_shifted":{},"shift":[{},0]}})",
                            images.empty() ? "" : ",",
                            24 + (other > 0 && pixels != 1.2 ? other : gain), pixels);
    }
    run.write(fmt::format("eval/iteration_{}/metrics.json", iteration),
              fmt::format(R"({{"images":[{}]}})", images));
    run.write("metrics.json", fmt::format(R"({{"complete":true,"photos":[],"evaluations":[
                {{"iteration":{},"psnr":24,"views":3}}]}})",
                                          iteration));
    run.write("config.toml", "poses = " + poses + "\n");
    return contains(run_report(run.path()),
                    "nearer to the model once each is shifted, by 1.2 pixels in the median, as "
                    "where poses are inexact: try --poses.");
  };
  CHECK(names_poses(0.6, 300, "false"));
  CHECK_FALSE(names_poses(0.4, 301, "false"));
  CHECK_FALSE(names_poses(3, 302, "true"));
  CHECK_FALSE(names_poses(3, 50, "false"));
  // One photo with a wrong pose is none of all.
  CHECK_FALSE(names_poses(5, 303, "false", 0.1));
}

TEST_CASE("a photo of a plain wall is not called blurred, one of a lens cap is named") {
  const Run run;
  const auto is_named = [&](const char* warning, double sharpness, double coarse) {
    std::string list;
    for (int i = 0; i < 9; ++i)
      list += fmt::format(R"({{"name":"{}.png","sharpness":{},"coarse_sharpness":0.2}},)", i,
                          0.05 + 0.01 * (i % 3));
    run.write("metrics.json", fmt::format(R"({{"complete":true,"photos":[{}
                {{"name":"last.png","sharpness":{},"coarse_sharpness":{}}}]}})",
                                          list, sharpness, coarse));
    return contains(run_report(run.path()), warning + std::string(": last.png."));
  };
  const auto is_blurred = [&](double sharpness, double coarse) {
    return is_named("which blur the model", sharpness, coarse);
  };
  CHECK(is_blurred(0.005, 0.2));
  CHECK(is_blurred(0.005, 0.05));
  CHECK_FALSE(is_blurred(0.005, 0.02));
  CHECK_FALSE(is_blurred(0.05, 0.5));
  const auto is_plain = [&](double sharpness, double coarse) {
    return is_named("of one colour, which hide what is there: leave them out", sharpness, coarse);
  };
  CHECK(is_plain(0, 0));
  CHECK_FALSE(is_blurred(0, 0));
  CHECK(is_plain(0.001, 0.00003));  // noise of a black photo
  CHECK_FALSE(is_plain(0.001, 0.003));
  // Photos that an older version has read have one number alone.
  run.write("metrics.json", R"({"complete":true,"photos":[
    {"name":"0.png","sharpness":0.05,"coarse_sharpness":0.2},{"name":"1.png","sharpness":0.06},
    {"name":"2.png","sharpness":0.05},{"name":"3.png","sharpness":0.06},
    {"name":"4.png","sharpness":0.05},{"name":"old.png","sharpness":0.002}]})");
  CHECK(contains(run_report(run.path()), "which blur the model: old.png."));
}

TEST_CASE("a photo is compared with those beside it that look the same way") {
  const Run run;
  // Twelve photos along a line look along z; of two at its end one looks another way.
  const auto names_last = [&](double psnr, const std::string& direction, double beside) {
    std::string list;
    for (int i = 0; i < 12; ++i) {
      list +=
          fmt::format(R"({{"name":"{0}.png","psnr":{1},"center":[{0},0,0],"direction":[0,0,1]}},)",
                      i, i > 9 ? beside : 24 + i % 4);
    }
    list += fmt::format(R"({{"name":"last.png","psnr":{},"center":[12,0,0],"direction":{}}})", psnr,
                        direction);
    run.write("metrics.json",
              fmt::format(R"({{"complete":true,"iteration":500,"photos":[{}]}})", list));
    return contains(run_report(run.path()), "or something in them has moved: last.png.");
  };
  const std::string along = "[0,0,1]", oblique = "[0.6,0,0.8]", across = "[1,0,0]";
  CHECK(names_last(17, along, 25));
  CHECK(names_last(17, oblique, 25));
  CHECK_FALSE(names_last(17, along, 19));
  // What it alone shows is learned worse; a wrong pose costs more than that.
  CHECK_FALSE(names_last(17, across, 25));
  CHECK(names_last(11, across, 25));
  // That those beside it are as bad is no excuse for one that looks elsewhere.
  CHECK(names_last(11, across, 12));
  CHECK_FALSE(names_last(11, along, 12));
}

TEST_CASE("a run whose held-out photos differ from the model by their colours names --exposure") {
  const Run run;
  const std::string advice =
      "Held-out photos are 2.1 dB nearer to the model once their colours are fitted, as where "
      "exposure or white balance changes between photos: try --exposure, and judge it by "
      "psnr_corrected.";
  const auto page_of = [&](double psnr, double corrected, int iteration = 300) {
    run.write("metrics.json", fmt::format(R"({{"complete":true,"iteration":{0},"evaluations":[
      {{"iteration":{0},"psnr":{1},"psnr_corrected":{2},"views":7}}]}})",
                                          iteration, psnr, corrected));
    return run_report(run.path());
  };
  run.write("config.toml", "exposure = false\n");
  CHECK(contains(page_of(24.66, 26.8), advice));
  for (const auto& [psnr, corrected] :
       {std::pair(25.2, 26.21), std::pair(39.5, 42.7), std::pair(14.2, 17.3), std::pair(16.2, 19.3),
        std::pair(24.66, 0.0)}) {
    CAPTURE(psnr);  // a usual capture, a dark one, models that fail, a run of an older version
    CHECK(!contains(page_of(psnr, corrected), "--exposure"));
  }
  CHECK(!contains(page_of(24.66, 26.8, 90), "--exposure"));
  // Lamps that flicker, where colours bring much; a poor model where they bring less.
  CHECK(contains(page_of(17.22, 20.95), "try --exposure"));
  CHECK(!contains(page_of(18.9, 21.6), "--exposure"));
  // Most views have to gain: what lies before two of seven cameras is no exposure.
  const auto with_views = [&](double usual) {
    std::string images;
    for (int i = 0; i < 7; ++i) {
      images += fmt::format(R"({}{{"psnr":24.66,"psnr_corrected":{}}})", i > 0 ? "," : "",
                            24.66 + (i < 2 ? 5.0 : usual));
    }
    run.write("eval/iteration_300/metrics.json", R"({"images":[)" + images + "]}");
    return page_of(24.66, 26.8);
  };
  CHECK(contains(with_views(2.0), "Held-out photos are 2.0 dB nearer"));
  CHECK(!contains(with_views(0.9), "--exposure"));
  run.write("config.toml", "exposure = true\n");
  CHECK(!contains(page_of(24.66, 26.8), "try --exposure"));
}
