// SPDX-License-Identifier: Apache-2.0
// What read_scene_file() says of files that it refuses.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "unit/io/scene_folder.hpp"

using namespace raysplats;
using namespace raysplats::test;

TEST_CASE("scene file: what is wrong is named with its line") {
  const SceneFolder folder;
  const auto usage = [&](const std::string& text, const std::vector<std::string>& parts) {
    const std::string message = folder.refused<UsageError>(text);
    INFO(text);
    INFO(message);
    CHECK(contains(message, "scene.toml"));
    for (const std::string& part : parts) CHECK(contains(message, part));
  };
  const std::string material = "[[material]]\nname = 'a'\nkind = 'mirror'\n";

  usage("", {"shows nothing"});
  usage("[camera]\nfile = \n", {"line 2"});
  usage(kModel + "[rendr]\n", {"line 3", "'rendr'", "'render'"});
  usage(kModel + "scael = 2\n", {"line 3", "'scael'", "[[model]]", "'scale'"});
  usage(kMesh + "turn = {axis = [0, 1, 0], degrees = 3, pivt = [0, 0, 0]}\n",
        {"line 3", "'pivt'", "'pivot'"});
  usage(kModel + "[render]\nmax-bounce = 3\n", {"line 4", "'max-bounces'"});
  usage(kModel + "[render]\nmax-bounces = 3\nmax_bounces = 3\n", {"twice"});
  usage(kModel + "[render.shadows]\nstrenght = 0\n", {"'strength'"});
  usage(kModel + "[animation]\nframe = 3\n", {"'frames'"});
  usage(kModel + "[trace]\nqq = 3\n", {"unknown key 'qq'"});
  usage(kModel + "[environment]\ncolour = [0, 0, 0]\n", {"'color'"});
  usage(kModel + "[[light]]\nkind = 'point'\nposition = [0, 0, 0]\nradius = 1\n", {"'radius'"});
  usage(material + "ior = 1.5\n" + kModel, {"line 4", "'ior' is for kind = \"glass\""});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\nk1 = 1\n", {"'k1'"});

  // Keys that exist, but not for the kind that is chosen.
  const std::string placed = kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\n";
  const std::string orbit = kModel + "[camera]\norbit = {}\n";
  usage(kMesh + "crease-angle = 30\n", {"line 3", "'crease-angle' is for normals = \"smooth\""});
  usage(kModel + "[[light]]\nkind = 'point'\nposition = [0, 0, 0]\nradius = 1\n",
        {"line 6", "'radius' is for kind = \"sphere\""});
  usage(kModel + "[[light]]\nkind = 'point'\nposition = [0, 0, 0]\ndirection = [0, 0, 1]\n",
        {"'direction' is for kind = \"directional\""});
  usage(kModel + "[[light]]\nkind = 'directional'\nposition = [0, 0, 0]\ndirection = [0, 0, 1]\n",
        {"'position' is for the kinds point and sphere"});
  usage(placed + "k1 = 1\n", {"line 6", "'k1' is for the models opencv and fisheye"});
  usage(placed + "model = 'fisheye'\np2 = 1\n", {"'p2' is for model = \"opencv\""});
  usage(placed + "model = 'opencv'\nk4 = 1\n", {"'k4' is for model = \"fisheye\""});
  usage(placed + "extent = 2\n", {"'extent' is for model = \"orthographic\""});
  for (const std::string key : {"fov", "focal"}) {
    for (const std::string model : {"equirectangular", "orthographic"}) {
      usage(placed + "model = '" + model + "'\n" + key + " = 50\n",
            {"'" + key + "' is for the models pinhole, opencv and fisheye"});
    }
  }
  usage(orbit + "model = 'equirectangular'\nprincipal-point = [1, 2]\n",
        {"'principal-point' is for every model but equirectangular"});
  usage(placed + "split = 'all'\n", {"'split' is for the views of 'data'"});
  usage(orbit + "undistort = false\n", {"'undistort' is for the views of 'data'"});
  usage(placed + "views = [1]\n", {"'views' is for 'file' and the views of 'data'"});
  usage(placed + "downscale = 2\n", {"'downscale' is for 'file' and 'data'"});
  usage(orbit + "target = [0, 0, 0]\n", {"'target' is for 'position'", "orbit.target"});
  for (const std::string key : {"width", "model", "fov", "k1"}) {
    usage(kModel + "[camera]\nfile = 'model.ply'\n" + key + " = 3\n",
          {"line 5", "'" + key + "' is for 'position' and 'orbit'"});
  }

  usage("model = 3\n", {"line 1", "[[model]]"});
  usage(kModel + "scale = 'big'\n", {"line 3", "'scale'", "list of 3 numbers", "a text"});
  usage(kModel + "translate = [1, 2]\n", {"3 numbers"});
  usage(kModel + "translate = [1, 2, 'x']\n", {"a text"});
  usage(kModel + "translate = [1, 2, inf]\n", {"finite"});
  usage(kModel + "rotate = {axis = [0, 0, 0], degrees = 3}\n", {"'axis'", "direction"});
  usage(kModel + "rotate = {degrees = 3}\n", {"'axis'"});
  usage(kModel + "scale = [1, 0, 1]\n", {"'scale'", "0"});
  usage(kModel + "matrix = [1, 2]\n", {"16 numbers"});
  usage(kModel + "matrix = [1,0,0,0, 0,1,0,0, 0,0,1,0, 1,0,0,1]\n", {"last row"});
  usage(kModel + "matrix = [1,0,0,0, 0,0,0,0, 0,0,1,0, 0,0,0,1]\n", {"invertible"});
  usage(kModel + "scale = 2\nmatrix = [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n", {"stands alone"});
  usage("[[model]]\nscale = 1\n", {"line 1", "no 'file'"});
  usage("[[model]]\nfile = ''\n", {"empty"});
  usage("[[model]]\nfile = 3\n", {"text in quotes"});

  usage(kMesh + "material = 'steel'\n", {"line 1", "'steel'"});
  usage(kMesh + "material = 'b'\n" + material, {"line 1", "'b'", "'a'"});
  usage(kMesh + "material = {Body = 'b'}\n" + material, {"'b'", "'a'"});
  usage(kMesh + "material = {Body = 3}\n" + material, {"'Body'", "text"});
  usage(kMesh + "normals = 'round'\n", {"smooth", "'round'"});
  usage(kMesh + "normals = 'smooth'\ncrease-angle = 200\n", {"'crease-angle'", "180"});
  usage(kMesh + "turn = {axis = [0, 1, 0]}\n", {"'degrees'"});
  usage(kMesh + material + material, {"two [[material]]", "'a'"});
  usage(kMesh + "[[material]]\nkind = 'mirror'\n", {"no 'name'"});
  usage(kMesh + "[[material]]\nname = 'a'\n", {"no 'kind'"});
  usage(kMesh + "[[material]]\nname = 'a'\nkind = 'metal'\n", {"mirror or glass", "'metal'"});
  usage(kMesh + material + "color = [0, 2, 0]\n", {"'color'", "0 to 1"});
  usage(kMesh + material + "shadow = true\n", {"'shadow'", "a number", "true or false"});
  usage(kMesh + "[[light]]\nposition = [0, 0, 0]\n", {"no 'kind'"});
  usage(kMesh + "[[light]]\nkind = 'point'\n", {"no 'position'"});
  usage(kMesh + "[[light]]\nkind = 'directional'\n", {"no 'direction'"});

  usage(kModel + "[render]\nsamples = 1.5\n", {"whole number"});
  usage(kModel + "[render]\nsamples = 0\n", {"'samples'", "1 to"});
  usage(kModel + "[render]\nmax-bounces = 0\n", {"'max-bounces'", "1 to"});
  usage(kModel + "[render]\nlight-samples = 1025\n", {"'light-samples'", "1024"});
  usage(kModel + "[render]\nseed = -1\n", {"'seed'"});
  usage(kModel + "[render]\nindirect = 1\n", {"true or false"});
  usage(kModel + "[trace]\npacket-width = 3\n", {"'packet-width'"});
  usage(kModel + "[trace]\nhit-order = 'first'\n", {"entry or peak"});
  usage(kModel + "[animation]\nframes = 0\n", {"'frames'"});

  usage(kModel + "[camera]\n", {"line 3", "'position'"});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\n", {"no 'target'"});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 1]\n", {"same point"});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\norbit = {}\n", {"one of"});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\nfov = 3\nfocal = 3\n",
        {"leave one out"});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\nfov = 180\n", {"179"});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\nmodel = 'orthographic'\n",
        {"'extent'"});
  usage(kModel + "[camera]\nfile = 'model.ply'\nviews = [-1]\n", {"'views'"});
  usage(kModel + "[camera]\norbit = {frames = 2.9}\n", {"'frames'", "whole number"});
  usage(kModel + "[camera]\norbit = {frames = 0}\n", {"'frames'"});

  for (const std::string& text :
       {std::string("[[model]]\nfile = 'none.ply'\n"), std::string("[[mesh]]\nfile = 'none.ply'\n"),
        kModel + "[camera]\nfile = 'none.ply'\n", kModel + "[camera]\ndata = 'none.ply'\n",
        kModel + "[environment]\nimage = 'none.ply'\n",
        kMesh + material + "texture = 'none.ply'\n"}) {
    const std::string message = folder.refused<DataError>(text);
    INFO(message);
    CHECK(contains(message, "scene.toml, line "));
    CHECK(contains(message, "none.ply does not exist"));
  }
  CHECK_THROWS_AS(read_scene_file(folder.scratch() / "absent.toml"), DataError);
}

TEST_CASE("scene file: keys of any number of parts end in a sentence") {
  const SceneFolder folder;
  const auto parts = [](int count) {
    std::string key = "a";
    for (int i = 1; i < count; ++i) key += ".a";
    return key;
  };
  const auto refusal = [&](const std::string& text) {
    const std::string message = folder.refused<UsageError>(text);
    CHECK(!contains(message, "\n"));
    return message;
  };
  for (const int count : {65, 32000}) {
    CAPTURE(count);
    for (const std::string& line :
         {parts(count) + " = 1", "[" + parts(count) + "]", "[[" + parts(count) + "]]",
          "x = { " + parts(count) + " = 1 }", "'a'.\"b.\\\"\" . " + parts(count - 2) + " = 1",
          "x = [{}, { b = 2, " + parts(count) + " = 1 }]"}) {
      CHECK(contains(refusal("\n" + line + "\n"),
                     "scene.toml, line 2: a key has more than 64 parts"));
    }
  }
  // Tables in tables count together.
  std::string inner = "1";
  for (int i = 0; i < 200; ++i) inner = "{ " + parts(60) + " = " + inner + " }";
  CHECK(contains(refusal("x = " + inner + "\n"), "line 1: a key has more than 64 parts"));
  // What is no key may have any number of dots.
  const std::string dots(500, '.');
  std::string values;
  for (int i = 0; i < 200; ++i) values += "1.5, 1979-05-27T07:32:00.5, ";
  for (const std::string& line :
       {parts(64) + " = 1", "x = '" + dots + "'", "x = \"\"\"" + dots + "\n" + dots + "\"\"\"",
        "x = 1 # " + parts(500), "x = [" + values + "]", "'" + dots + "' = 1",
        "x = [{" + parts(50) + " = 1}, {" + parts(50) + " = 1}]"}) {
    CAPTURE(line);
    CHECK(contains(refusal(line + "\n"), "unknown key"));
  }
}
