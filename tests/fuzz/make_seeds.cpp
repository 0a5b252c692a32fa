// SPDX-License-Identifier: Apache-2.0
// Writes the seed corpora of the fuzz targets: small sound files of every format and dialect.
// usage: fuzz_seeds DIRECTORY      (tests/fuzz/corpus in the source tree)
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "bench/report.hpp"
#include "io/zip_archive.hpp"
#include "raysplats/io.hpp"
#include "run/checkpoint.hpp"
#include "run/train_config.hpp"

using namespace raysplats;

namespace {

namespace fs = std::filesystem;

/// A corpus: a folder of inputs.
class Corpus {
 public:
  Corpus(const fs::path& root, const char* target) : folder_(root / target) {
    fs::create_directories(folder_);
  }
  void add(const std::string& name, std::string_view bytes) const {
    std::ofstream stream(folder_ / name, std::ios::binary | std::ios::trunc);
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  /// The file with a choice in front, as take_choice() reads it; the file itself goes.
  void add_chosen(const std::string& name, char choice, const fs::path& file) const {
    std::ifstream stream(file, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(stream)), {});
    add(name, std::string(1, choice).append(bytes));
    stream.close();
    fs::remove(file);
  }
  const fs::path& folder() const { return folder_; }

 private:
  fs::path folder_;
};

/// Little-endian binary file under construction.
class Bytes {
 public:
  template <class T>
  Bytes& add(T value) {
    const std::size_t at = text_.size();
    text_.resize(at + sizeof(T));
    std::memcpy(text_.data() + at, &value, sizeof(T));
    return *this;
  }
  Bytes& add_text(std::string_view text) {
    text_ += text;
    return *this;
  }
  std::string take(char choice) const { return std::string(1, choice).append(text_); }

 private:
  std::string text_;
};

Gaussians small_model(int degree, std::size_t count) {
  Gaussians model;
  model.sh_degree = degree;
  model.resize(count);
  for (std::size_t i = 0; i < model.means.size(); ++i)
    model.means[i] = 0.25f * static_cast<float>(i);
  for (float& value : model.log_scales) value = -2.0f;
  for (std::size_t i = 0; i < count; ++i) model.quaternions[4 * i] = 1.0f;
  for (float& value : model.sh) value = 0.1f;
  return model;
}

void make_ply(const fs::path& root) {
  const Corpus corpus(root, "ply");
  write_ply(corpus.folder() / "degree0.ply", small_model(0, 2));
  write_ply(corpus.folder() / "degree1.ply", small_model(1, 1));
  write_model(corpus.folder() / "packed.compressed.ply", small_model(1, 2));
  const std::string model_properties =
      "property float x\nproperty float y\nproperty float z\nproperty float f_dc_0\n"
      "property float f_dc_1\nproperty float f_dc_2\nproperty float opacity\n"
      "property float scale_0\nproperty float scale_1\nproperty float scale_2\n"
      "property float rot_0\nproperty float rot_1\nproperty float rot_2\nproperty float rot_3\n";
  corpus.add("ascii_model.ply", "ply\nformat ascii 1.0\nelement vertex 1\n" + model_properties +
                                    "end_header\n0 1 2 .1 .2 .3 0 -1 -1 -1 1 0 0 0\n");
  corpus.add(
      "ascii_points.ply",
      "ply\nformat ascii 1.0\nelement camera 1\nproperty int id\nelement vertex 2\n"
      "property float x\nproperty float y\nproperty float z\nproperty uchar red\n"
      "property uchar green\nproperty uchar blue\nelement face 0\n"
      "property list uchar int vertex_index\nend_header\n7\n0 0 0 255 0 0\n1 1e0 -1 0 9 8\n");
  corpus.add("big_endian.ply",
             std::string("ply\r\nformat binary_big_endian 1.0\r\ncomment c\r\nelement vertex 1\r\n"
                         "property double x\r\nproperty short y\r\nproperty uint z\r\n"
                         "end_header\r\n") +
                 std::string("\x3f\xf0\0\0\0\0\0\0\xff\xfe\0\0\0\x07", 14));
}

void make_colmap(const fs::path& root) {
  const Corpus corpus(root, "colmap");
  const auto camera = [](Bytes& bytes, std::uint32_t id, std::int32_t model, int parameters) {
    bytes.add(id).add(model).add(std::uint64_t{8}).add(std::uint64_t{6});
    for (int i = 0; i < parameters; ++i) bytes.add(3.5);
  };
  Bytes cameras;
  cameras.add(std::uint64_t{3});
  camera(cameras, 1, 1, 4);
  camera(cameras, 2, 4, 8);
  camera(cameras, 3, 2, 4);
  corpus.add("cameras_bin", cameras.take(0));
  Bytes images;
  images.add(std::uint64_t{2});
  for (std::uint32_t i = 0; i < 2; ++i) {
    images.add(i).add(1.0).add(0.0).add(0.0).add(0.0).add(0.5).add(0.0).add(2.0).add(1u);
    images.add_text(fmt::format("{}.png", i)).add('\0').add(std::uint64_t{i});
    for (std::uint32_t k = 0; k < i; ++k) images.add(1.0).add(2.0).add(std::uint64_t{7});
  }
  corpus.add("images_bin", images.take(1));
  Bytes points;
  points.add(std::uint64_t{2});
  for (std::uint64_t i = 0; i < 2; ++i) {
    points.add(i).add(0.5).add(1.0).add(-2.0).add('a').add('b').add('c').add(0.1).add(i);
    for (std::uint64_t k = 0; k < i; ++k) points.add(1u).add(2u);
  }
  corpus.add("points_bin", points.take(2));
  corpus.add("cameras_txt",
             "\3# cameras\n1 PINHOLE 8 6 7 7 4 3\n2 SIMPLE_RADIAL 8 6 7 4 3 0.01\n"
             "3 OPENCV 8 6 7 7 4 3 .1 .01 .001 -.001\n4 SIMPLE_PINHOLE 8 6 7 4 3\n"
             "5 RADIAL 8 6 7 4 3 .1 .2\n");
  corpus.add("images_txt",
             "\4# images\n1 1 0 0 0 0 0 2 1 a b.png\n1.5 2.5 -1\n2 .7 .7 0 0 1 2 3 1 b.png\n\n");
  corpus.add("points_txt", "\5# points\n1 0 0 1 255 128 0 0.5 1 0\n2 1e0 -2 3.5 0 0 0 1\n");
}

void make_transforms(const fs::path& root) {
  const Corpus corpus(root, "transforms");
  const std::string matrix = R"("transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]])";
  corpus.add("blender.json", R"({"camera_angle_x":0.69,"frames":[{"file_path":"./train/r_0",)" +
                                 matrix + R"(}],"w":8,"h":6})");
  corpus.add("nerfstudio.json",
             R"({"camera_model":"OPENCV","fl_x":7,"fl_y":7.5,"cx":4,"cy":3,"w":8,"h":6,"k1":0.01,)"
             R"("p1":1e-3,"ply_file_path":"points.ply","train_filenames":["a.png"],)"
             R"("val_filenames":[],"test_filenames":["b.png"],"frames":[{"file_path":"a.png",)"
             R"("mask_path":"m.png",)" +
                 matrix + R"(},{"file_path":"b.png","fl_x":9,"w":4,"h":3,)" + matrix + "}]}");
  corpus.add(
      "list.json",
      R"([{"img_name":"a.png","width":8,"height":6,"position":[1,2,3],"rotation":[[1,0,0],[0,1,0],[0,0,1]],
"fx":7,"fy":7.5,"cx":3,"cy":2.5,"camera_model":"OPENCV_FISHEYE","k1":0.01,"k4":1e-3},
{"width":8,"height":4,"position":[0,0,4],"rotation":[[1,0,0],[0,1,0],[0,0,1]]}])");
}

void make_config(const fs::path& root) {
  const Corpus corpus(root, "config");
  corpus.add("default.toml", to_toml({}));
  corpus.add("table.toml",
             "# comment\n[train]\niterations = 10 # end\nresolution-schedule = [5, 7]\n"
             "background = \"0.5,0,1\"\nsparse-adam = false\nsave-at = 3,4\npixel-loss = 'l2'\n");
}

void make_device_files(const fs::path& root) {
  const Corpus tuning(root, "tuning");
  tuning.add("one.json",
             R"({"schema":"raysplats-tuning","schema_version":1,"devices":[{"device":"device",)"
             R"("platform":"platform","driver":"1","raysplats":"0.1.0","packet_width":8,)"
             R"("tile":16,"pending":32,"group":0}]})");
  const Corpus cache(root, "kernel_cache");
  Bytes bytes;
  bytes.add_text("RSKERN01").add(std::uint64_t{6}).add(std::uint64_t{0}).add_text("binary");
  cache.add("sound", bytes.take(1));
  cache.add("wrong_checksum", bytes.take(0));
}

void make_images(const fs::path& root) {
  const Corpus corpus(root, "image");
  Image color(5, 3, 3);
  for (std::size_t i = 0; i < color.data.size(); ++i) {
    color.data[i] = static_cast<float>(i) / static_cast<float>(color.data.size());
  }
  const auto temporary = [&](const char* name) {
    return corpus.folder() / (std::string("temporary_") + name);
  };
  for (const char* name : {"rgb.png", "rgb.jpg", "rgb.exr"}) {
    write_image(temporary(name), color);
    corpus.add_chosen(name, 1, temporary(name));
  }
  write_image(temporary("rgba.png"), Image(4, 4, 4, 0.5f));
  corpus.add_chosen("rgba.png", 1, temporary("rgba.png"));
  const std::vector<std::uint8_t> grey{0, 60, 120, 255};
  for (const char* name : {"grey.tif", "grey.bmp"}) {
    const fs::path path = temporary(name);
    const auto output = OIIO::ImageOutput::create(path.string());
    const OIIO::ImageSpec spec(2, 2, 1, OIIO::TypeUInt8);
    if (output && output->open(path.string(), spec)) {
      output->write_image(OIIO::TypeUInt8, grey.data());
      output->close();
    }
    corpus.add_chosen(name, 1, path);
  }
}

void make_reports(const fs::path& root) {
  BenchReport report;
  report.version = "0.1.0";
  report.device = "device";
  report.options["scene"] = "spheres";
  report.rows.resize(1);
  Corpus(root, "report").add("one.json", bench_json(report));
}

void make_runs(const fs::path& root) {
  const Corpus runs(root, "run");
  const auto add = [&](const char* name, char choice, const std::string& text) {
    runs.add(name, std::string(1, choice) + text);
  };
  add("metrics", 0, R"({"complete":true,"iteration":2,"iterations":2,"gaussians":9,"device":"cpu",
"traced_rays":9,"capped_rays":1,"most_gaussians":9,"seed":7,"driver":"<script>",
"kernels":[{"name":"<script>","calls":3,"ms":1.5,"share":0.9},{"name":7}],"evaluations":[{"iteration":1,"psnr":21.5,"ssim":0.8,"views":1},
{"iteration":2,"training_seconds":3,"psnr":20,"ssim":0.75,"views":1}]})");
  add("other_types", 0, R"({"complete":"<script>","iteration":[],"gaussians":"1","device":{},
"psnr_rise":true,"evaluations":[1,{"iteration":"2","psnr":null}]})");
  add("views", 1,
      R"({"images":[{"name":"a<script>.png","psnr":30,"ssim":0.9,"picture":"a.png",
"center":[1,2,3],"sharpness":0.1,"coarse_sharpness":0.2,"psnr_shifted":31,"shift":[0.5,1]}]})");
  add("views_of_other_types", 1, R"({"images":[{"name":7,"picture":["a.png"],"psnr":"30"},[]]})");
  add("rows", 2, "iteration,seconds,loss,psnr,gaussians,it_per_s\n10,1.5,0.5,12,100,7\n20,cut");
  add("cameras", 4,
      R"([{"img_name":"<script>","position":[1,2,3],"rotation":[[1,0,0],[0,1,0],[0,0,1]]},
{"position":[1e300,0,0]},{"position":[1,2],"rotation":[1,[],"x"]},7])");
  add("exposures", 5, R"({"<script>":[[1,0,0,0],[0,1.1,0,0],[0,0,0.9,0]],"b":[1,[2],{}],"c":7})");
  add("settings", 3, "# <script>\niterations = 200\nname = \"<script>\"\n");
}

void make_checkpoints(const fs::path& root) {
  const Corpus corpus(root, "checkpoint");
  Checkpoint checkpoint;
  checkpoint.iteration = 7;
  checkpoint.count = 1;
  checkpoint.scale_activation = "exp";
  checkpoint.config = "iterations = 7\n";
  checkpoint.sections["means"] = {1.0f, 2.0f, 3.0f};
  checkpoint.sections["opacities"] = {0.5f};
  checkpoint.sections["density"] = {};
  for (const char choice : {'\0', '\1'}) {
    const fs::path path = corpus.folder() / "temporary.rsck";
    write_checkpoint(path, checkpoint);
    corpus.add_chosen(choice == 0 ? "checked.rsck" : "repaired.rsck", choice, path);
  }
}

void make_meshes(const fs::path& root) {
  const Corpus corpus(root, "mesh");
  corpus.add("square.obj",
             std::string(1, '\0') +
                 "mtllib input.mtl\no a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\n"
                 "vn 0 0 1\nusemtl m\nf 1/1/1 2/2/1 3/1/1 -1/2/1\nf -4 -3 -2\n");
  corpus.add(
      "material.mtl",
      std::string(1, '\0') +
          "newmtl m\nKd .5 .5 .5\nKs 1 1 1\nNs 20\nKe 0 0 0\nNi 1.5\nd .5\nillum 3\n"
          "map_Kd input.png\nmtllib input.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
  corpus.add("triangle.ply",
             "\1ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
             "property float z\nproperty float nx\nproperty float ny\nproperty float nz\n"
             "property float s\nproperty float t\nelement face 1\n"
             "property list uchar int vertex_indices\nend_header\n0 0 0 0 0 1 0 0\n"
             "1 0 0 0 0 1 1 0\n0 1 0 0 0 1 0 1\n3 0 1 2\n");
  const std::string gltf =
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,)"
      R"("translation":[0,0,1],"rotation":[0,0,0,1],"scale":[1,1,1],"children":[1]},{}],"meshes":)"
      R"([{"primitives":[{"attributes":{"POSITION":0},"indices":1,"material":0}]}],"materials":)"
      R"([{"pbrMetallicRoughness":{"baseColorFactor":[1,0,0,1],"metallicFactor":0}}],"buffers":)"
      R"([{BUFFER"byteLength":44}],"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},)"
      R"({"buffer":0,"byteOffset":36,"byteLength":6}],"accessors":[{"bufferView":0,"componentType")"
      R"(:5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},{"bufferView":1,)"
      R"("componentType":5123,"count":3,"type":"SCALAR"}]})";
  const auto with_buffer = [&](const std::string& uri) {
    std::string text = gltf;
    return text.replace(text.find("BUFFER"), 6, uri);
  };
  corpus.add("triangle.gltf",
             "\2" + with_buffer(R"("uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAA)"
                                R"(AACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIAAAA=",)"));
  std::string json = with_buffer("");
  json.resize((json.size() + 3) / 4 * 4, ' ');
  Bytes glb;
  glb.add_text("glTF").add(2u).add(static_cast<std::uint32_t>(12 + 8 + json.size() + 8 + 44));
  glb.add(static_cast<std::uint32_t>(json.size())).add_text("JSON").add_text(json);
  glb.add(44u).add_text(std::string_view("BIN\0", 4));
  for (const float value : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f}) glb.add(value);
  for (const std::uint16_t index : {0, 1, 2, 0}) glb.add(index);
  const std::string binary = glb.take(3);
  corpus.add("triangle.glb", binary);
  // The same from memory.
  corpus.add("alone.obj", "\4mtllib input.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
  corpus.add("alone.ply",
             "\5ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
             "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
             "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  corpus.add("alone.glb", "\6" + binary.substr(1));
}

void make_models(const fs::path& root) {
  const Corpus corpus(root, "model");
  const fs::path temporary = corpus.folder() / "temporary";
  const auto add = [&](const char* name, char choice, const char* extension, int version) {
    const fs::path path = fs::path(temporary).replace_extension(extension);
    write_model(path, small_model(1, 2), {SpzAxes::kPly, version});
    corpus.add_chosen(name, choice, path);
  };
  add("four.spz", 1, ".spz", 4);
  add("three.spz", 1, ".spz", 3);
  add("two.splat", 2, ".splat", 3);
  add("two.glb", 3, ".glb", 3);
  add("two.sog", 6, ".sog", 3);
  // The files of a SOG, as the target packs them.
  const fs::path sog = fs::path(temporary).replace_extension(".sog");
  write_model(sog, small_model(1, 2));
  std::ifstream stream(sog, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(stream)), {});
  const io::ZipArchive archive(std::as_bytes(std::span(bytes)), sog);
  const auto pack = [&](const std::string& meta) {
    Bytes packed;
    packed.add(static_cast<std::uint16_t>(meta.size())).add_text(meta);
    for (const char* name : {"means_l.webp", "means_u.webp", "scales.webp", "quats.webp",
                             "sh0.webp", "shN_centroids.webp", "shN_labels.webp"}) {
      const std::vector<std::byte> file = archive.read(name);
      packed.add(static_cast<std::uint16_t>(file.size()));
      packed.add_text({reinterpret_cast<const char*>(file.data()), file.size()});
    }
    return packed;
  };
  const std::vector<std::byte> text = archive.read("meta.json");
  const Bytes packed = pack({reinterpret_cast<const char*>(text.data()), text.size()});
  corpus.add("packed_sog", packed.take(5));
  corpus.add("deflated_sog", packed.take(7));
  corpus.add("folder_sog", packed.take(8));
  // The first version has ranges where the second has codebooks.
  corpus.add("first_sog",
             pack(R"({"means":{"shape":[2,3],"mins":[0,0,0],"maxs":[1,1,1],)"
                  R"("files":["means_l.webp","means_u.webp"]},"scales":{"mins":[-2,-2,-2],)"
                  R"("maxs":[0,0,0],"files":["scales.webp"]},"quats":{"encoding":)"
                  R"("quaternion_packed","files":["quats.webp"]},"sh0":{"mins":[0,0,0,-4],)"
                  R"("maxs":[1,1,1,4],"files":["sh0.webp"]},"shN":{"mins":-1,"maxs":1,)"
                  R"("files":["shN_centroids.webp","shN_labels.webp"]}})")
                 .take(5));
  stream.close();
  fs::remove(sog);
  // What is compressed in SPZ of each older version.
  for (std::uint32_t version = 1; version <= 3; ++version) {
    Bytes bytes;
    bytes.add('\0').add_text("NGSP").add(version).add(1u).add('\0').add('\x0c').add('\0').add('\0');
    const std::size_t arrays = (version == 1 ? 6 : 9) + 1 + 3 + 3 + (version < 3 ? 3 : 4);
    bytes.add_text(std::string(arrays, '\x40'));
    corpus.add(fmt::format("version{}", version), bytes.take(1));
  }
}

void make_paths(const fs::path& root) {
  const Corpus corpus(root, "camera_path");
  corpus.add("keys.toml", std::string(1, '\0') +
                              "fps = 12\nclosed = true\nwidth = 8\nheight = 6\n[[key]]\n"
                              "eye = [0, -1, -4]\ntarget = [0, 0, 0]\nseconds = 1\n[[key]]\n"
                              "eye = [3, -1, 2]\ntarget = [0, 0, 0]\nup = [0, -1, 0]\nfov = 35\n");
  const auto path = [](int x) {
    return fmt::format(
        R"({{"camera_to_world":[1,0,0,{0},0,1,0,0,0,0,1,4,0,0,0,1],"fov":50,"aspect":1.5}})", x);
  };
  const std::string head =
      R"({"camera_type":"perspective","render_width":8,"render_height":6,"fps":4,"seconds":1,)";
  const std::string frames = head + R"("camera_path":[)" + path(0) + "," + path(1) + "]}";
  corpus.add("frames.json", "\1" + frames);
  corpus.add("keyframes.json",
             "\2" + head +
                 R"("is_cycle":true,"keyframes":[{"matrix":"[1,0,0,0,0,1,0,0,0,0,1,0,0,0,4,1]",)"
                 R"("fov":50,"aspect":1.5},{"matrix":[1,0,0,2,0,1,0,0,0,0,1,4,0,0,0,1],"fov":60,)"
                 R"("aspect":1.5}]})");
  corpus.add("scaled.json", "\3" + frames.substr(0, frames.size() - 1) +
                                R"(,"transform":[[1,0,0,0],[0,1,0,0],[0,0,1,0]],"scale":0.5})");
}

void make_view(const fs::path& root) {
  const Corpus corpus(root, "view");
  const std::string seen = R"("id":1,"fov":50,"size":[64,48],"c2w":[1,0,0,0,0,1,0,0,0,0,1,-6])";
  corpus.add("view.json", R"({"type":"view",)" + seen +
                              R"(,"moving":true,"near":0.5,"background":[0,0.5,1],"order":"peak",)"
                              R"("output":"depth"})");
  corpus.add("pick.json", R"({"type":"pick",)" + seen + R"(,"px":[0.5,0.25]})");
  corpus.add("fisheye.json", R"({"type":"view",)" + seen + R"(,"model":"fisheye"})");
  corpus.add("panorama.json",
             R"({"type":"view",)" + seen + R"(,"model":"equirectangular","png":true})");
  corpus.add("scene.json", R"({"type":"scene",)" + seen + "}");
  for (const std::string type : {"pause", "resume", "save", "leave", "meshes"})
    corpus.add(type + ".json", R"({"type":")" + type + R"("})");
  corpus.add("share.json", R"({"type":"share","share":0.25})");
  corpus.add("remove.json", R"({"type":"remove","mesh":1})");
  const std::string placed = R"("material":"glass","at":[0,0,1],"rotate":[0,90,0],"size":0.5})";
  corpus.add("mesh.json", R"({"type":"mesh","format":"obj","name":"a.obj","bytes":100,)" + placed);
  corpus.add("place.json", R"({"type":"place","mesh":1,"moving":true,)" + placed);
}

void make_scenes(const fs::path& root) {
  const Corpus corpus(root, "scene");
  corpus.add("small.toml", R"([[model]]
file = "model.ply"
translate = [0, 1, 0]
[[mesh]]
file = "mesh.obj"
matrix = [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]
material = "gold"
normals = "smooth"
crease-angle = 40
turn = { axis = [0, 1, 0], degrees = 360 }
move = [0, 0, 1]
[[mesh]]
file = "mesh.obj"
scale = 0.5
rotate = { axis = [0, 0, 1], degrees = 25 }
[[material]]
name = "gold"
kind = "mirror"
color = [0.9, 0.7, 0.3]
texture = "image.png"
roughness = 0.1
[[light]]
kind = "sphere"
position = [1.5, -3, 0.5]
radius = 0.3
intensity = 8
[[light]]
kind = "directional"
direction = [0, 1, 0]
[environment]
image = "image.png"
[camera]
width = 16
height = 9
fov = 50
up = [0, -1, 0]
orbit = { frames = 3, elevation = 15, distance = 3 }
[render]
samples = 2
max-bounces = 4
[render.shadows]
strength = 0.6
[animation]
frames = 3
)");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: fuzz_seeds DIRECTORY\n");
    return 2;
  }
  const fs::path root = argv[1];
  make_ply(root);
  make_colmap(root);
  make_transforms(root);
  make_config(root);
  make_device_files(root);
  make_images(root);
  make_reports(root);
  make_runs(root);
  make_checkpoints(root);
  make_meshes(root);
  make_models(root);
  make_paths(root);
  make_view(root);
  make_scenes(root);
  return 0;
}
