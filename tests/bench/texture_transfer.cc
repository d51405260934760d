// planish_texture_transfer looks [--detail=N] [--texels=N] [--points=N]: how much the looks of textured models change
// when they get a map of planish's own: colours through the old map and image against the new ones, at random points of
// the surface, in 255ths; of noise, letters and JPEG beside a resampler of 64 samples a texel; normals in degrees. Exit
// code 1 if a limit is not kept: 2 in the mean and 12 at the 99th percentile of smooth content, a tenth more than the
// reference of other content, 2 degrees.
//
// planish_texture_transfer samples FOLDER [--detail=N] [--texels=N]: writes the models that "looks" compares, as
// FOLDER/NAME.glb; names of those with smooth content begin with "smooth_".
//
// planish_texture_transfer write FILE [--texels=N]; planish_texture_transfer cost FILE: a mesh of 100,000 triangles
// with four maps; then the seconds of CPU that resampling the maps takes beside decoding and encoding them as PNG, and
// the most memory that the process had. Exit code 1 if resampling takes longer, or the memory is above 600 MB.
//
// planish_texture_transfer project: a scan of 200,000 triangles onto a copy of 20,000, in images of 2048 texels a side.
// Exit code 1 if normals are off by more than 3 degrees in the mean, or more than 0.5 % of the texels are missed.
#include <malloc.h>
#include <sys/resource.h>

#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <numbers>
#include <random>
#include <string>

#include "CLI/CLI.hpp"
#include "client/files/gltf_accessor.h"
#include "client/files/gltf_document.h"
#include "client/files/gltf_mesh.h"
#include "client/files/surface_projection.h"
#include "tests/texture/sample_models.h"

namespace planish {
namespace {

double CpuSeconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

double MostMegabytes() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024 / 1e6;
}

int CompareLooks(int detail, int texels, int points) {
  bool is_good = true;
  std::printf(
      "| model | triangles | materials | mean | 99 %% | reference | 99 %% | normals "
      "|\n|---|---|---|---|---|---|---|---|\n");
  for (const SampleModel& model : SampleModels(detail, texels)) {
    const MeshFile before = Opened(model.Glb());
    const MeshFile after = WithNewMap(before);
    const ModelDifference difference = CompareModels(before, after, points);
    std::string other = " | ", normals;
    bool holds = difference.color.mean <= 2 && difference.color.percentile99 <= 12;
    char text[64];
    if (model.materials[0].is_normal) {
      holds = difference.normal_mean_degrees <= 2;
      std::snprintf(text, sizeof text, "%.2f", difference.normal_mean_degrees);
      normals = text;
    } else if (!model.is_smooth) {
      const Difference reference = ReferenceDifference(before, after, points);
      std::snprintf(text, sizeof text, "%.2f | %.2f", reference.mean, reference.percentile99);
      other = text;
      holds = difference.color.mean <= 1.1 * reference.mean &&
              difference.color.percentile99 <= 1.1 * reference.percentile99;
    }
    std::printf("| %s%s | %lld | %zu | %.2f | %.2f | %s | %s |\n", model.name.c_str(), holds ? "" : " **fails**",
                static_cast<long long>(before.mesh.num_polygons()), model.materials.size(), difference.color.mean,
                difference.color.percentile99, other.c_str(), normals.c_str());
    std::fflush(stdout);
    is_good &= holds;
  }
  return is_good ? 0 : 1;
}

int WriteSamples(const std::string& folder, int detail, int texels) {
  for (const SampleModel& model : SampleModels(detail, texels)) {
    const bool is_smooth = model.is_smooth && !model.materials[0].is_normal;
    std::ofstream file(folder + "/" + (is_smooth ? "smooth_" : "") + model.name + ".glb", std::ios::binary);
    file << model.Glb();
    if (!file) return 1;
  }
  return 0;
}

// Waves and a little noise, as in photographs.
TextureImage Photograph(int texels, std::uint32_t seed) {
  std::minstd_rand random(seed);
  return MakeTexture(texels, texels, 3, 8, [&](double x, double y, int c) {
    return 0.5 + 0.3 * std::sin(x / (40 + 7 * c) + y / 90) + 0.01 * static_cast<double>(random() % 3);
  });
}

// A sheet of hills with a base colour, normals, metallic and roughness, and an emission.
std::string FourMaps(int texels) {
  constexpr double kPi = std::numbers::pi;
  SampleModel model = {"four", true, {}, {}};
  const auto place = [](double x, double y) {
    return Vec3(x, -y, 0.02 * std::sin(6 * kPi * x) * std::cos(4 * kPi * y));
  };
  model.patches.push_back({place, 250, 200, 0});
  for (std::uint32_t i = 0; i < 4; ++i) model.materials.push_back({Photograph(texels, i + 1), i == 1});
  GltfDocument document = *ParseGltf("four.glb", model.Glb());
  Json& material = document.json["materials"][0];
  material["normalTexture"] = {{"index", 1}};
  material["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {{"index", 2}};
  material["emissiveTexture"] = {{"index", 3}};
  document.json["materials"] = Json::array({material});
  return *GlbBytes(document.json, document.buffers[0], "");
}

// One chart, turned.
std::vector<double> TurnedUv(const PolygonMesh& mesh) {
  std::vector<double> uv;
  for (const std::int32_t vertex : mesh.corner_vertex) {
    const Vec3& p = mesh.positions[static_cast<std::size_t>(vertex)];
    const double x = p.x() - 0.5, y = p.y() + 0.5;
    uv.insert(uv.end(), {0.5 + 0.75 * (0.8 * x - 0.6 * y) / 1.1, 0.5 + 0.75 * (0.6 * x + 0.8 * y) / 1.1});
  }
  return uv;
}

// What decoding all images of a file takes, and encoding them again.
struct CodecSeconds {
  double decoding = 0, encoding = 0;
};

CodecSeconds CodecSecondsOf(const MeshFile& model) {
  CodecSeconds seconds;
  for (const Json& image : model.gltf->document.json["images"]) {
    const std::string_view bytes = *ViewBytes(model.gltf->document, image["bufferView"], "image");
    const double begin = CpuSeconds();
    const TextureImage decoded = *DecodeImage(bytes, "image");
    const double middle = CpuSeconds();
    const std::string encoded = *EncodeImage(decoded);
    seconds.decoding += middle - begin;
    seconds.encoding += CpuSeconds() - middle;
  }
  return seconds;
}

int MeasureCost(const std::string& file) {
  mallopt(M_MMAP_THRESHOLD, 4 << 20);  // as the command does
  const MeshFile model = *ReadMeshFile(file);
  std::printf("read: %.0f MB\n", MostMegabytes());
  const double begin = CpuSeconds();
  OutputOptions options;
  options.path = "four_out.glb";
  options.format = MeshFormat::kGlb;
  options.textures.mode = TextureMode::kTransfer;
  const Json& json = model.gltf->document.json;
  options.textures.size =
      ReadImageHeader(*ViewBytes(model.gltf->document, json["images"][0]["bufferView"], "image"), "image")->width;
  const WrittenMesh written = *WriteMeshWithUv(model, TurnedUv(model.mesh), options);
  const double all = CpuSeconds() - begin, memory = MostMegabytes();
  std::printf("%zu bytes in, %zu out\n", static_cast<std::size_t>(model.gltf->document.num_bytes),
              written.files.back().bytes.size());
  // New images are smoother than old ones, and are encoded in less time.
  const CodecSeconds before = CodecSecondsOf(model), after = CodecSecondsOf(Opened(written.files.back().bytes));
  const double codec = before.decoding + before.encoding, resampling = all - before.decoding - after.encoding;
  std::printf("%lld triangles: decoding and encoding %.1f s, resampling and all else %.1f s (%.2f of it), %.0f MB\n",
              static_cast<long long>(model.mesh.num_polygons()), codec, resampling, resampling / codec, memory);
  return resampling <= codec && memory <= 600 ? 0 : 1;
}

int MeasureProjection() {
  const MeshFile scan = *ReadMeshBytes("scan.ply", MeshFormat::kPly, ScanPly(129));
  const MeshFile copy = Opened(DecimatedGlb(41));
  OutputOptions output;
  output.path = "out.glb";
  output.format = MeshFormat::kGlb;
  const double begin = CpuSeconds();
  const ProjectedMesh projected = *ProjectSurface(scan, copy, output, {});
  const double seconds = CpuSeconds() - begin;
  const MeshFile written = Opened(projected.written.files.back().bytes);
  const ProjectionDifference difference = CompareWithScan(written, 100000);
  const double missed = static_cast<double>(projected.missed) / static_cast<double>(projected.texels);
  std::printf(
      "%lld triangles onto %lld: normals %.2f degrees in the mean, colours %.2f of 255, %.3f %% missed, %.1f s\n",
      static_cast<long long>(scan.mesh.num_polygons()), static_cast<long long>(copy.mesh.num_polygons()),
      difference.normal_mean_degrees, difference.color_mean, 100 * missed, seconds);
  return difference.normal_mean_degrees <= 3 && missed < 0.005 ? 0 : 1;
}

}  // namespace
}  // namespace planish

int main(int argc, char** argv) {
  CLI::App app("Measures how textured models look with a new map");
  int detail = 64, texels = 512, points = 100000, side = 4096;
  std::string write, read;
  CLI::App& looks = *app.add_subcommand("looks", "How models look before and after");
  looks.add_option("--detail", detail, "Squares a side of a patch [64]");
  looks.add_option("--texels", texels, "Of a side of the images [512]");
  looks.add_option("--points", points, "Of the surface [100000]");
  CLI::App& samples = *app.add_subcommand("samples", "The models of looks");
  samples.add_option("FOLDER", write)->required();
  samples.add_option("--detail", detail, "Squares a side of a patch [64]");
  samples.add_option("--texels", texels, "Of a side of the images [512]");
  CLI::App& write_four = *app.add_subcommand("write", "A model with four maps");
  write_four.add_option("FILE", write)->required();
  write_four.add_option("--texels", side, "Of a side of the images [4096]");
  CLI::App& cost = *app.add_subcommand("cost", "Time and memory of such a model");
  cost.add_option("FILE", read)->required();
  CLI::App& project = *app.add_subcommand("project", "A scan onto its decimated copy");
  app.require_subcommand(1);
  CLI11_PARSE(app, argc, argv);
  if (samples.parsed()) return planish::WriteSamples(write, detail, texels);
  if (looks.parsed()) return planish::CompareLooks(detail, texels, points);
  if (project.parsed()) return planish::MeasureProjection();
  if (cost.parsed()) return planish::MeasureCost(read);
  std::ofstream(write, std::ios::binary) << planish::FourMaps(side);
  return 0;
}
