// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "report/bench_page.hpp"
#include "report/chart.hpp"
#include "report/figures.hpp"
#include "report/html.hpp"
#include "report/run_report.hpp"
#include "unit/report/written_run.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using test::contains;
using test::Run;
namespace fs = std::filesystem;

namespace {

/// What is wrong with the nesting and the escapes of a document, "" for nothing: a small part of
/// what an XML parser checks.
std::string fault(const std::string& text) {
  std::vector<std::string> open;
  std::size_t at = text.find("<html");
  while (at < text.size()) {
    const char c = text[at];
    if (c == '&') {
      const std::size_t end = text.find(';', at);
      if (end == std::string::npos || end - at > 6) return "a bare & at " + text.substr(at, 20);
    }
    if (c != '<') {
      ++at;
      continue;
    }
    const std::size_t end = text.find('>', at);
    if (end == std::string::npos) return "a tag without end";
    const std::string tag = text.substr(at + 1, end - at - 1);
    if (contains(tag, "<")) return "a < in " + tag;
    if (tag.starts_with("/")) {
      if (open.empty() || open.back() != tag.substr(1)) return "an end that does not fit: " + tag;
      open.pop_back();
    } else if (!tag.ends_with("/")) {
      open.push_back(tag.substr(0, tag.find_first_of(" \n")));
    }
    at = end + 1;
  }
  return open.empty() ? "" : "no end of " + open.back();
}

/// Views at places, looking up, as RunFolder writes them; `more` stands behind them.
void write_cameras(const Run& run,
                   const std::vector<std::pair<std::string, glm::ivec3>>& views,
                   const std::string& more = "") {
  std::string text;
  for (const auto& [name, at] : views) {
    text += fmt::format(
        R"({}{{"img_name":"{}","position":[{},{},{}],"rotation":[[1,0,0],[0,1,0],[0,0,1]],)"
        R"("width":8,"height":6}})",
        text.empty() ? "" : ",", name, at.x, at.y, at.z);
  }
  run.write("cameras.json", "[" + text + (more.empty() ? "" : "," + more) + "]");
}

}  // namespace

TEST_CASE("a report holds what the run says, escaped, and nothing from elsewhere") {
  const Run run;
  const std::string page = run_report(run.path());
  CHECK(fault(page) == "");
  CHECK(contains(page, "<p>Complete: 20.2 dB on 3 held-out views, 2 warnings.</p>"));
  CHECK(contains(page, "PSNR 20.25 dB"));
  CHECK(contains(page, "5.00 % of the rays stopped at --max-hits"));
  CHECK(contains(page, "ends 1.25 dB below its best, at iteration 100"));
  CHECK(contains(page, "&lt;cpu&gt; &amp; co"));
  CHECK(contains(page, "raysplats train &#39;a&lt;b&#39;"));
  CHECK(contains(page, "00112233445566778899aabbccddeeff"));
  CHECK(contains(page, "Worst: a&lt;b&gt;&amp;.png, 10.00 dB"));
  CHECK(contains(page, "Best: good.png, 30.00 dB"));
  CHECK(contains(page, "Typical: mid.png, 20.00 dB: the run wrote no picture of it"));
  CHECK(contains(page, "data:image/jpeg;base64,/9j/"));
  CHECK(contains(page, "&quot;&lt;script&gt;&quot;"));
  CHECK(!contains(page, "<script"));
  CHECK(!contains(page, "http:"));
  CHECK(!contains(page, "https:"));
  CHECK(contains(page, "<polyline"));
  write_run_report(run.path(), run.path() / "report.html");
  CHECK(fs::file_size(run.path() / "report.html") == page.size());
}

TEST_CASE("what is written of a run comes with a line about its warnings, if it has any") {
  const Run run;
  const fs::path file = run.path() / "page.html";
  CHECK(write_run_report(run.path(), file) ==
        "2 warnings in " + file.string() +
            ", the first: 5.00 % of the rays stopped at --max-hits: raise it");
  run.write("metrics.json", R"({"complete":true,"traced_rays":1000,"capped_rays":50})");
  CHECK(write_run_report(run.path(), file) ==
        "1 warning in " + file.string() + ": 5.00 % of the rays stopped at --max-hits: raise it");
  run.write("metrics.json", R"({"complete":true})");
  CHECK(write_run_report(run.path(), file).empty());
}

TEST_CASE("a damaged picture is told in its place, and the others are shown") {
  const Run run("_<one>"), other("_two");
  run.write("eval/iteration_200/good.png", "damaged");
  const std::string page = run_report(run.path());
  CHECK(fault(page) == "");
  CHECK(contains(page, "<p>Best: good.png, 30.00 dB: The image "));
  CHECK(contains(page, "<figure><img alt=\"a&lt;b&gt;&amp;.png\" src=\"data:image/jpeg"));
  CHECK(!contains(page, "<figure><img alt=\"good.png\""));
  const std::string both = runs_report({run.path(), other.path()});
  CHECK(fault(both) == "");
  CHECK(contains(both, "<p>A: good.png, 30.00 dB: The image "));
  CHECK(contains(both, "<figcaption>B: good.png, 30.00 dB (photo, render, error)"));
}

TEST_CASE("a report of a run that is under way or damaged says so") {
  const Run run;
  run.write("metrics.json", R"({"iteration":7,"iterations":90})");
  fs::remove(run.path() / "metrics.csv");
  const std::string page = run_report(run.path());
  CHECK(fault(page) == "");
  CHECK(contains(page, "<p>Not over: nothing measured yet, 1 warning.</p>"));
  CHECK(contains(page, "7 of 90 iterations"));
  CHECK(contains(page, "no held-out views"));
  run.write("metrics.json", "{");
  CHECK_THROWS_AS(run_report(run.path()), DataError);
  fs::remove(run.path() / "metrics.json");
  CHECK_THROWS_AS(run_report(run.path()), DataError);
}

TEST_CASE("a model or cameras that cannot be read are told in their place of a report") {
  const Run run;
  const fs::path folder = run.path() / "point_cloud/iteration_200";
  fs::create_directories(folder);
  Gaussians model;
  model.resize(3);
  write_ply(folder / "point_cloud.ply", model, {});
  std::string bytes = read_bytes(folder / "point_cloud.ply");
  const float none = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(bytes.data() + bytes.size() - sizeof(none), &none, sizeof(none));
  write_bytes(folder / "point_cloud.ply", bytes);
  run.write("cameras.json", "[{");
  run.write("exposures.json", "[]");
  fs::remove(run.path() / "config.toml");
  const std::string page = run_report(run.path());
  CHECK(fault(page) == "");
  for (const char* part : {"<h2>Model</h2>\n<p class=\"warn\">", "point_cloud.ply",
                           "<h2>Cameras</h2>\n<p class=\"warn\">", "cameras.json",
                           "<h2>Exposure</h2>\n<p class=\"warn\">", "exposures.json",
                           "<p>There is no config.toml that tells them.</p>"})
    CHECK_MESSAGE(contains(page, part), part);
  CHECK(!contains(page, "All settings are the defaults"));
}

TEST_CASE("members of another type count as missing") {
  const Run run;
  run.write("metrics.json", R"({"device":7,"iteration":"x","complete":1,"evaluations":[
    {"iteration":200,"psnr":"good"}]})");
  run.write("eval/iteration_200/metrics.json",
            R"({"images":[{"name":["a"],"picture":{},"psnr":"30","ssim":null},{"name":"b"}]})");
  CHECK(fault(run_report(run.path())) == "");
  CHECK(fault(runs_report({run.path(), run.path()})) == "");
}

TEST_CASE("pages stay below 3 MB whatever the photos are") {
  // Noise, which JPEG cannot make small; the panels are red, green and blue.
  Image large(3 * 600, 400, 3);
  std::uint32_t state = 1;
  for (int y = 0; y < large.height; ++y) {
    for (int x = 0; x < large.width; ++x) {
      state = state * 1664525u + 1013904223u;
      large.at(x, y, x / 600) = static_cast<float>(state >> 8) / 16777216.0f;
    }
  }
  constexpr std::size_t kMost = 3'000'000;
  std::vector<std::unique_ptr<Run>> runs;
  std::vector<fs::path> folders;
  for (int i = 0; i < 12; ++i) {
    runs.push_back(std::make_unique<Run>(std::to_string(i)));
    folders.push_back(runs.back()->path());
    const fs::path eval = folders.back() / "eval/iteration_200";
    for (const char* name : {"good.png", "a<b>&.png"}) {
      fs::remove(eval / name);
      if (i == 0) {
        write_image(eval / name, large);
      } else {
        fs::create_symlink(folders.front() / "eval/iteration_200/good.png", eval / name);
      }
    }
  }
  const std::string one = run_report(folders.front());
  CHECK(one.size() < kMost);
  CHECK(one.size() > 100'000);  // and not smaller than has to be
  const std::string twelve = runs_report(folders);
  CHECK(twelve.size() < kMost);
  CHECK(twelve.size() > 500'000);
}

TEST_CASE("panels are averaged apart, and small ones are kept as they are") {
  const Run run;
  const fs::path file = run.path() / "wide.png";
  Image wide(3 * 961, 300, 3);
  for (int y = 0; y < wide.height; ++y) {
    for (int x = 0; x < wide.width; ++x) {
      wide.at(x, y, x / 961) = x % 2 == 0 ? 0.9f : 0.5f;
    }
  }
  write_image(file, wide);
  const report::Figure figure{file, "wide", "wide"};
  const auto decoded = [&](const std::string& html) {
    const std::string mark = "base64,";
    const std::size_t at = html.find(mark) + mark.size();
    const std::string text = html.substr(at, html.find('"', at) - at);
    std::vector<unsigned char> bytes;
    std::uint32_t word = 0;
    int bits = 0;
    for (const char c : text) {
      const std::string letters =
          "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
      if (c == '=') break;
      word = word << 6 | static_cast<std::uint32_t>(letters.find(c));
      bits += 6;
      if (bits >= 8) bytes.push_back(static_cast<unsigned char>(word >> (bits -= 8) & 255u));
    }
    run.write("shown.jpg", std::string(bytes.begin(), bytes.end()));
    return read_image(run.path() / "shown.jpg");
  };
  const Image shown = decoded(report::figures(std::span(&figure, 1)));
  CHECK(shown.width == 3 * 480);
  CHECK(shown.height == 150);
  for (int panel = 0; panel < 3; ++panel) {
    CHECK(shown.at(480 * panel + 240, 75, panel) == doctest::Approx(0.7).epsilon(0.03));
    CHECK(shown.at(480 * panel + 240, 75, (panel + 1) % 3) < 0.05f);
  }
  write_image(file, Image(30, 20, 3, 0.5f));
  const Image same = decoded(report::figures(std::span(&figure, 1)));
  CHECK(same.width == 30);
  CHECK(same.height == 20);
}

TEST_CASE("a picture is the file that its evaluation names, of that folder alone") {
  const Run run;
  const fs::path eval = run.path() / "eval/iteration_200";
  write_image(eval / "left_0001.png", Image(12, 4, 3, 0.5f));
  run.write("eval/iteration_200/metrics.json",
            R"({"images":[{"name":"left/0001.png","psnr":30,"picture":"left_0001.png"}]})");
  CHECK(contains(run_report(run.path()), "alt=\"left/0001.png\" src=\"data:"));
  write_image(run.path() / "outside.png", Image(12, 4, 3, 0.5f));
  run.write("eval/iteration_200/metrics.json",
            R"({"images":[{"name":"0001.png","psnr":30,"picture":"../../outside.png"}]})");
  CHECK(!contains(run_report(run.path()), "data:image"));
}

TEST_CASE("a report shows model, cameras, exposure, kernels and where it all comes from") {
  const Run run;
  const std::string bare = run_report(run.path());
  for (const char* heading : {"<h2>Model", "<h2>Cameras", "<h2>Exposure"})
    CHECK(!contains(bare, heading));
  const std::string advice = "The run was too short for one of its steps to be timed";
  CHECK(contains(bare, advice));
  run.write("metrics.json",
            R"({"complete":true,"seed":42,"driver":"<d>","data":"00ff","version":"9.8",
    "kernels":[{"name":"trace<x>","calls":12,"ms":340,"share":0.75}],
    "evaluations":[{"iteration":200,"psnr":20}]})");
  write_cameras(run, {{"a", {0, 0, 0}}, {"", {4, 0, 0}}}, R"({"position":"none"})");
  run.write("eval/iteration_200/metrics.json",
            R"({"images":[{"name":"<low>","psnr":10,"center":[1,0,0]},
              {"name":"high","psnr":30,"center":[2,-2,0]}]})");
  run.write("exposures.json", R"({"a":[[1.5,0,0,0],[0,1,0,0],[0,0,1,0]],"b":[],
    "c":[[0.5,0,0,0],[0,1,0,0],[0,0,1,0]]})");
  Gaussians model;
  model.resize(40);
  for (std::size_t i = 0; i < 10; ++i) model.opacities[i] = 9;
  for (const char* folder : {"iteration_100", "iteration_9", "iteration_x"})
    fs::create_directories(run.path() / "point_cloud" / folder);
  write_ply(run.path() / "point_cloud/iteration_100/point_cloud.ply", model, {});
  const std::string page = run_report(run.path());
  CHECK(fault(page) == "");
  CHECK(contains(page, "<th>Seed</th><td>42</td>"));
  CHECK(contains(page, "<td>&lt;d&gt;</td>"));
  CHECK(contains(page, "<td>00ff</td>"));
  CHECK(contains(page, "<th>trace&lt;x&gt;</th><td>12</td><td>340.0</td>"));
  CHECK(contains(page, "75.0 %"));
  CHECK(contains(page, "<p>Device time of the whole run.</p>"));
  CHECK(!contains(page, advice));
  CHECK(contains(page, "<p>Complete: 20.0 dB on 0 held-out views, nothing to warn of.</p>"));
  CHECK(contains(page, "large, held out: orange 10.00 dB to blue 30.00 dB"));
  CHECK(contains(page, ">grey: trained on<"));
  CHECK(contains(page, "<title>&lt;low&gt;, 10.00 dB</title>"));
  CHECK(contains(page, "fill=\"rgb(214,96,30)\""));
  // 4 units across fill the width between margins; the view 2 units up stands on top of the side.
  CHECK(contains(page, "cx=\"34.0\""));
  CHECK(contains(page, "cx=\"426.0\""));
  CHECK(contains(page, "cx=\"230.0\" cy=\"52.0\" r=\"5\" fill=\"rgb(60,120,215)\""));
  CHECK(contains(page, "aria-label=\"Gain of the colours\""));
  // 30 of 40 stand at an opacity of a half: the highest bar, in the middle.
  CHECK(contains(page, "x=\"250.0\" y=\"30.0\""));
  for (const auto& [steps, text] : {std::pair(1, "1 step"), std::pair(2, "2 steps")}) {
    run.write(
        "metrics.json",
        fmt::format(R"({{"timed_steps":{},"kernels":[{{"name":"k","share":0.75}}]}})", steps));
    CHECK(contains(run_report(run.path()),
                   fmt::format("<p>Device time in {} of training, one of every 32.</p>", text)));
  }
}

TEST_CASE("cameras that were trained on have the colours of their own PSNR") {
  const Run run;
  write_cameras(run, {{"<a>", {0, 0, 0}}, {"b", {4, 0, 0}}, {"c", {2, 1, 0}}, {"d", {1, 1, 0}}});
  run.write("eval/iteration_200/metrics.json",
            R"({"images":[{"name":"low","psnr":10,"center":[1,0,0]},
              {"name":"high","psnr":30,"center":[2,-2,0]}]})");
  run.write("metrics.json", R"({"complete":true,"evaluations":[{"iteration":200,"psnr":20}],
    "photos":[{"name":"<a>","psnr":25,"center":[0,0,0]},{"name":"b","psnr":35,"center":[4,0,0]},
              {"name":"c","sharpness":0.1,"center":[2,1,0]}]})");
  const std::string page = run_report(run.path());
  CHECK(fault(page) == "");
  CHECK(contains(page, "large, held out: orange 10.00 dB to blue 30.00 dB"));
  CHECK(
      contains(page, "small, trained on: orange 25.00 dB to blue 35.00 dB; grey: not yet at full"));
  CHECK(contains(page, "r=\"3\" fill=\"rgb(214,96,30)\"><title>&lt;a&gt;, 25.00 dB</title>"));
  CHECK(contains(page, "r=\"3\" fill=\"rgb(60,120,215)\"><title>b, 35.00 dB</title>"));
  CHECK(contains(page, "class=\"plain\""));
}

TEST_CASE("reports say what views measure where they fit") {
  const Run refined("_refined"), plain("_plain");
  refined.write("metrics.json", R"({"complete":true,"evaluations":[
    {"iteration":200,"psnr":20.5,"psnr_aligned":24.25,"ssim":0.75,"views":1}]})");
  const std::string page = run_report(refined.path());
  CHECK(contains(page, "<p>Complete: 20.5 dB on 1 held-out view, 24.2 dB where they fit, "));
  CHECK(contains(page, "<td>PSNR 20.50 dB (24.25 where they fit), SSIM 0.7500, 1 view</td>"));
  const std::string both = runs_report({plain.path(), refined.path()});
  CHECK(contains(both, "<th>The same where the views fit, dB</th><td></td><td>24.25</td>"));
  CHECK(!contains(runs_report({plain.path(), plain.path()}), "where the views fit"));
}

TEST_CASE("reports say by which command a run was last resumed") {
  const Run resumed("_resumed"), plain("_plain");
  resumed.write("metrics.json",
                R"({"complete":true,"command":"one","commands":["one","two","<three>"]})");
  CHECK(contains(run_report(resumed.path()), "&lt;three&gt;"));
  CHECK(!contains(run_report(plain.path()), "last by"));
  CHECK(contains(runs_report({plain.path(), resumed.path()}),
                 "<tr><th>Resumed, last by</th><td></td><td>&lt;three&gt;</td></tr>"));
}

TEST_CASE("several runs stand side by side, with what differs between them") {
  const Run first("_<one>"), second("_two"), third("_three");
  second.write("metrics.json",
               R"({"complete":true,"iteration":300,"gaussians":999,"device":"other","evaluations":[
          {"iteration":200,"training_seconds":9,"psnr":23.5,"ssim":0.7,"views":1}],
          "driver":"<d> 2","data":"00aa","model_hash":"00bb"})");
  second.write("config.toml", "iterations = 300\nname = \"<script>\"\nseed = 7\n");
  second.write("eval/iteration_200/metrics.json",
               R"({"images":[{"name":"a<b>&.png","psnr":11,"ssim":0.5},
                 {"name":"good.png","psnr":36,"ssim":0.9},{"name":"own.png","psnr":20}]})");
  const std::string page = runs_report({first.path(), second.path()});
  CHECK(fault(page) == "");
  CHECK(contains(page, "_&lt;one&gt;</th>"));
  CHECK(contains(page, "<td>20.25</td><td><b>23.50</b></td>"));
  CHECK(contains(page, "<td><b>0.7500</b></td><td>0.7000</td>"));
  CHECK(contains(page, "<td>140</td><td>999</td>"));
  CHECK(contains(page, "<td>Complete: 20.2 dB on 3 held-out views, 2 warnings.<br/>"));
  CHECK(contains(page, "ends 1.25 dB below its best, at iteration 100.</span>"));
  CHECK(contains(page, "<td>Complete: 23.5 dB on 1 held-out view, nothing to warn of.</td>"));
  CHECK(contains(page, "<tr><th>Driver</th><td></td><td>&lt;d&gt; 2</td></tr>"));
  CHECK(contains(page, "data set</th><td></td><td>00aa</td></tr>"));
  CHECK(!contains(page, "<th>RaySplats-CL</th>"));  // which neither says
  CHECK(
      contains(page, "128 bits)</th><td>00112233445566778899aabbccddeeff</td><td>00bb</td></tr>"));
  // The view in which they differ by 6 dB comes before that in which they differ by one.
  const std::size_t good = page.find("A: good.png, 30.00 dB"), bad = page.find("A: a&lt;b");
  CHECK(good != std::string::npos);
  CHECK(bad != std::string::npos);
  CHECK(good < bad);
  CHECK(contains(page, "B: good.png, 36.00 dB"));
  CHECK(!contains(page, "own.png"));
  CHECK(contains(page, "<tr><th>seed</th><td></td><td>7</td></tr>"));
  CHECK(contains(page, "<tr><th>iterations</th><td>200</td><td>300</td></tr>"));
  CHECK(!contains(page, "<th>name</th>"));
  CHECK(!contains(page, "<script"));
  // Views of which all runs have a picture come first, however little they differ.
  fs::remove(second.path() / "eval/iteration_200/good.png");
  const std::string pictured = runs_report({first.path(), second.path()});
  CHECK(pictured.find("A: a&lt;b") < pictured.find("A: good.png"));
  CHECK(contains(pictured, "B: good.png, 36.00 dB: the run wrote no picture of it"));
  // A run without held-out views, and settings that are the same.
  third.write("metrics.json", R"({"iteration":7})");
  const std::string bare = runs_report({first.path(), third.path()});
  CHECK(fault(bare) == "");
  CHECK(contains(bare, "no held-out view in common"));
  CHECK(contains(bare, "All settings are the same"));
  // It hides the best numbers of none, wherever it stands.
  const std::string last = runs_report({third.path(), first.path(), second.path()});
  CHECK(contains(last, "<td></td><td>20.25</td><td><b>23.50</b></td>"));
  CHECK(contains(last, "<td></td><td><b>0.7500</b></td><td>0.7000</td>"));
  CHECK_THROWS_AS(runs_report({first.path()}), UsageError);
  CHECK_THROWS_AS(runs_report({first.path(), first.path() / "none"}), DataError);
}

TEST_CASE("runs of one folder name are told apart by the folders above") {
  const Run first("day 1/bike/run"), second("day 2/bike/run"), third("run"), fourth("other");
  const std::string two = runs_report({first.path(), second.path() / ""});
  CHECK(contains(two, "A: day 1/bike/run</th>"));
  CHECK(contains(two, "B: day 2/bike/run</th>"));
  CHECK(contains(two, "<title>day 1/bike/run, day 2/bike/run</title>"));
  const std::string two_others = runs_report({third.path(), fourth.path() / ""});
  CHECK(contains(two_others, "A: run</th>"));
  CHECK(contains(two_others, "B: other</th>"));
  // One folder twice has one name, whatever is taken in.
  CHECK(fault(runs_report({third.path(), third.path()})) == "");
}

TEST_CASE("runs of very many common views are compared in the time that reading them takes") {
  std::string images;
  constexpr int kViews = 20000;
  for (int i = 0; i < kViews; ++i) {
    images.append(i == 0 ? "" : ",").append("{\"name\":\"view_").append(std::to_string(i));
    images.append(".png\",\"psnr\":20}");
  }
  const Run first("one"), second("two");
  for (const Run* run : {&first, &second})
    run->write("eval/iteration_200/metrics.json", "{\"images\":[" + images + "]}");
  const auto start = std::chrono::steady_clock::now();
  const std::string page = runs_report({first.path(), second.path()});
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  CHECK(contains(page, "view_19999.png"));
  // It took 20 s where every view was sought among all.
  CHECK(seconds < 10);
}

TEST_CASE("text, bytes and curves as HTML has them") {
  CHECK(report::escaped("a<b>&\"'\x01\xff\xc3\xa9") ==
        "a&lt;b&gt;&amp;&quot;&#39;\xef\xbf\xbd\xef\xbf\xbd\xc3\xa9");
  const unsigned char bytes[] = {'M', 'a', 'n', 'M', 'a', 'M'};
  CHECK(report::data_url("x/y", std::span(bytes, 3)) == "data:x/y;base64,TWFu");
  CHECK(report::data_url("x/y", std::span(bytes, 2)) == "data:x/y;base64,TWE=");
  CHECK(report::data_url("x/y", std::span(bytes, 1)) == "data:x/y;base64,TQ==");
  CHECK(report::chart("none", "x", {}).empty());
  report::Curve curve{"noise", {}};
  for (int i = 0; i < 100000; ++i) curve.points.emplace_back(i, i == 77777 ? 5.0 : 0.0);
  const std::string svg = report::chart("a & b", "x", std::span(&curve, 1));
  CHECK(svg.size() < 30000);
  CHECK(contains(svg, "a &amp; b"));
  CHECK(contains(svg, ",30.0"));  // the spike reaches the top
  report::Curve one{"one", {{3, 4}}};
  CHECK(contains(report::chart("one", "x", std::span(&one, 1)), "<circle"));
}

TEST_CASE("a benchmark becomes a page with all rows, bars and, of several sizes, charts") {
  BenchReport bench;
  bench.device = "a card <1> & co";
  bench.options["filter"] = "^\"view\"";
  bench.ceilings = {1e9, 1e10};
  for (const std::size_t size : {1000u, 10000u}) {
    BenchRow row;
    row.name = "forward";
    row.scene = "a<b>";
    row.size = size;
    row.clock = "device";
    row.seconds = {5, 1e-6 * static_cast<double>(size), 1e-5, 0, 0};
    row.work = {{{"rays", 64000}, {"hits", 1e6}}, 250.0 * static_cast<double>(size), 0};
    bench.rows.push_back(row);
  }
  bench.left_out = {{"view/a<b>/1000000", "no time"}};
  const std::string page = bench_page(bench);
  CHECK(fault(page) == "");
  CHECK(contains(page, "a card &lt;1&gt; &amp; co"));
  CHECK(contains(page, "a&lt;b&gt;, 10000 Gaussians"));
  CHECK(contains(page, "64 Mrays/s"));
  CHECK(contains(page, "25.0 %"));
  CHECK(contains(page, "An image by tiles: log10"));
  CHECK(!contains(page, "Training: log10"));
  CHECK(contains(page, "view/a&lt;b&gt;/1000000: no time"));
  CHECK(!contains(page, "<script"));
  bench.rows.pop_back();
  CHECK(!contains(bench_page(bench), "log10"));
  CHECK(fault(bench_page({})) == "");
}
