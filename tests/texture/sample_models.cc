#include "tests/texture/sample_models.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <numbers>
#include <random>

#include "Eigen/Geometry"
#include "client/files/gltf_attribute.h"
#include "client/files/gltf_document.h"
#include "client/files/gltf_mesh.h"
#include "client/texture/tangents.h"
#include "tests/testing/unwrap_in_process.h"

namespace planish {
namespace {

constexpr double kPi = std::numbers::pi;

template <typename T>
T Must(absl::StatusOr<T> value) {
  if (!value.ok()) {
    std::cerr << value.status() << "\n";
    std::abort();
  }
  return *std::move(value);
}

// Both sides of a seam come to the same place.
double OnGrid(double x) {
  return std::round(x * 65536) / 65536 + 0.0;
}

class GlbBuilder {
 public:
  std::size_t View(const std::string& bytes) {
    buffer_.resize((buffer_.size() + 7) / 8 * 8);
    json_["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", buffer_.size()}, {"byteLength", bytes.size()}});
    buffer_ += bytes;
    return json_["bufferViews"].size() - 1;
  }
  std::size_t Accessor(const std::string& bytes, int component, std::size_t count, const char* type) {
    const std::size_t view = View(bytes);  // moves what is in json_
    json_["accessors"].push_back(
        {{"bufferView", view}, {"componentType", component}, {"count", count}, {"type", type}});
    return json_["accessors"].size() - 1;
  }
  Json& json() { return json_; }
  std::string Take() {
    json_["asset"]["version"] = "2.0";
    json_["buffers"] = Json::array({{{"byteLength", buffer_.size()}}});
    return Must(GlbBytes(json_, buffer_, ""));
  }

 private:
  Json json_;
  std::string buffer_;
};

template <typename T>
void Append(T value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof value);
}

Json PrimitiveOf(const SamplePatch& patch, GlbBuilder* glb) {
  std::string positions, normals, uv, indices;
  std::array<double, 3> low, high;
  low.fill(1e30), high.fill(-1e30);
  for (int j = 0; j <= patch.rows; ++j) {
    for (int i = 0; i <= patch.columns; ++i) {
      const double x = static_cast<double>(i) / patch.columns, y = static_cast<double>(j) / patch.rows;
      const Vec3 p = patch.place(x, y);
      constexpr double kStep = 1e-4;
      const Vec3 n = (patch.place(x + kStep, y) - patch.place(x - kStep, y))
                         .cross(patch.place(x, y + kStep) - patch.place(x, y - kStep))
                         .normalized();
      for (int k = 0; k < 3; ++k) {
        const double value = OnGrid(p[k]);
        low[static_cast<std::size_t>(k)] = std::min(low[static_cast<std::size_t>(k)], value);
        high[static_cast<std::size_t>(k)] = std::max(high[static_cast<std::size_t>(k)], value);
        Append(static_cast<float>(value), &positions);
        Append(static_cast<float>(-n[k]), &normals);
      }
      Append(static_cast<float>(patch.u0 + x * patch.du), &uv);
      Append(static_cast<float>(patch.v0 + y * patch.dv), &uv);
    }
  }
  for (int j = 0; j < patch.rows; ++j) {
    for (int i = 0; i < patch.columns; ++i) {
      const auto a = static_cast<std::uint32_t>(j * (patch.columns + 1) + i);
      const auto w = static_cast<std::uint32_t>(patch.columns + 1);
      // Outwards is against the cross product of the patch's axes, as v runs downwards.
      for (const std::uint32_t v : {a, a + w + 1, a + 1, a, a + w, a + w + 1}) Append(v, &indices);
    }
  }
  const auto vertices = static_cast<std::size_t>((patch.columns + 1) * (patch.rows + 1));
  Json primitive;
  primitive["attributes"]["POSITION"] = glb->Accessor(positions, 5126, vertices, "VEC3");
  glb->json()["accessors"].back()["min"] = low;
  glb->json()["accessors"].back()["max"] = high;
  primitive["attributes"]["NORMAL"] = glb->Accessor(normals, 5126, vertices, "VEC3");
  primitive["attributes"]["TEXCOORD_0"] = glb->Accessor(uv, 5126, vertices, "VEC2");
  primitive["indices"] =
      glb->Accessor(indices, 5125, static_cast<std::size_t>(6 * patch.columns * patch.rows), "SCALAR");
  primitive["material"] = patch.material;
  return primitive;
}

// The six sides of a cube of half-width 1.
Vec3 OnCube(int side, double x, double y) {
  const double a = 2 * x - 1, b = 2 * y - 1;
  switch (side) {
    case 0:
      return {1, -b, -a};
    case 1:
      return {-1, -b, a};
    case 2:
      return {a, 1, b};
    case 3:
      return {a, -1, -b};
    case 4:
      return {a, -b, 1};
    default:
      return {-a, -b, -1};
  }
}

Vec3 OnTorus(double x, double y) {
  const double a = 2 * kPi * x, b = -2 * kPi * y;
  return {(1 + 0.4 * std::cos(b)) * std::cos(a), (1 + 0.4 * std::cos(b)) * std::sin(a), 0.4 * std::sin(b)};
}

Vec3 OnHills(double x, double y) {
  return {2 * x, -2 * y, 0.15 * std::sin(7 * x) * std::cos(9 * y)};
}

// Black letters and bars on white.
TextureImage Letters(int width, int height) {
  return MakeTexture(width, height, 3, 8, [](double x, double y, int) {
    const int cx = static_cast<int>(x) % 16, cy = static_cast<int>(y) % 16;
    const bool stem = cx >= 3 && cx < 5, bar = cy >= 2 && cy < 4, slant = std::abs(cx + cy - 15) < 2;
    return stem || (bar && cx > 3 && cx < 12) || (slant && cx < 14) ? 0.05 : 0.95;
  });
}

}  // namespace

std::string SampleModel::Glb() const {
  GlbBuilder glb;
  Json primitives = Json::array();
  for (const SamplePatch& patch : patches) primitives.push_back(PrimitiveOf(patch, &glb));
  glb.json()["meshes"] = Json::array({{{"primitives", std::move(primitives)}}});
  glb.json()["nodes"] = Json::array({{{"mesh", 0}}});
  glb.json()["scenes"] = Json::array({{{"nodes", Json::array({0})}}});
  glb.json()["scene"] = 0;
  glb.json()["samplers"] = Json::array({Json::object(), {{"wrapS", 33648}, {"wrapT", 33648}}});
  for (std::size_t m = 0; m < materials.size(); ++m) {
    const SampleMaterial& material = materials[m];
    const Json texture = {{"index", m}};
    Json json = {{"name", name + std::to_string(m)}, {"pbrMetallicRoughness", {{"metallicFactor", 0}}}};
    if (material.is_normal) {
      json["normalTexture"] = texture;
    } else {
      json["pbrMetallicRoughness"]["baseColorTexture"] = texture;
    }
    glb.json()["materials"].push_back(std::move(json));
    glb.json()["textures"].push_back({{"source", m}, {"sampler", material.is_mirrored ? 1 : 0}});
    const std::size_t view = glb.View(Must(EncodeImage(material.image)));
    glb.json()["images"].push_back({{"bufferView", view}, {"mimeType", MimeType(material.image.header.kind)}});
  }
  return glb.Take();
}

std::vector<SampleModel> SampleModels(int detail, int texels) {
  const auto smooth = [texels](double aspect, std::uint32_t seed) {
    SampleMaterial material;
    material.image = SmoothTexture(static_cast<int>(texels * aspect), texels, 0.125, seed);
    return material;
  };
  const SamplePatch torus = {OnTorus, 2 * detail, detail, 0};
  const SamplePatch hills = {OnHills, detail, detail, 0};
  const auto cube = [detail](bool is_round) {
    std::vector<SamplePatch> sides;
    for (int side = 0; side < 6; ++side) {
      const auto place = [side, is_round](double x, double y) {
        const Vec3 p = OnCube(side, x, y);
        return is_round ? Vec3(p.normalized()) : p;
      };
      // Three by two squares, a little apart.
      sides.push_back({place, detail / 2, detail / 2, 0, (side % 3 + 0.02) / 3, (side / 3 + 0.02) / 2, 0.96 / 3, 0.48});
    }
    return sides;
  };
  std::vector<SampleModel> models;
  models.push_back({"hills", true, {hills}, {smooth(1, 1)}});
  models.push_back({"torus", true, {torus}, {smooth(2.5, 2)}});
  models.push_back({"sphere", true, cube(true), {smooth(1.5, 3)}});
  // Two materials, of images of different sizes.
  SampleModel box = {"box", true, cube(false), {smooth(1.5, 4), smooth(0.75, 5)}};
  for (std::size_t side = 3; side < 6; ++side) box.patches[side].material = 1;
  models.push_back(std::move(box));
  // A tube of three materials, one for each third.
  SampleModel tube = {"tube", true, {}, {smooth(1, 6), smooth(1, 7), smooth(1, 8)}};
  for (int part = 0; part < 3; ++part) {
    const auto place = [part](double x, double y) {
      const double a = 2 * kPi * x;
      return Vec3(std::cos(a), -6 * (y + part - 1.5), -std::sin(a));
    };
    tube.patches.push_back({place, detail, detail, part});
  }
  models.push_back(std::move(tube));
  SampleModel tiled = {"tiled", true, {torus}, {smooth(1, 9)}};
  tiled.patches[0].du = 3;
  tiled.patches[0].u0 = -0.4;
  models.push_back(std::move(tiled));
  // Two surfaces apart, one of them mirrored.
  SampleModel pair = {"pair", true, {torus, hills, hills}, {smooth(2.5, 10), smooth(1, 11), smooth(1, 12)}};
  pair.patches[1].material = 1;
  pair.patches[2].material = 2;
  pair.patches[2].place = [](double x, double y) { return Vec3(OnHills(x, y) + Vec3(0, 0, -2)); };
  pair.patches[2].du = 1.7;
  pair.patches[2].dv = 1.7;
  pair.materials[2].is_mirrored = true;
  models.push_back(std::move(pair));
  models.push_back({"letters", false, {hills}, {{Letters(texels, texels)}}});
  models.push_back({"noise", false, {hills}, {{NoiseTexture(texels, texels, 13)}}});
  SampleModel jpeg = {"jpeg", false, {hills}, {smooth(1, 14)}};
  jpeg.materials[0].image.header.kind = ImageKind::kJpeg;
  models.push_back(std::move(jpeg));
  SampleModel bumps = {"bumps", true, {torus}, {{}}};
  bumps.materials[0].is_normal = true;
  bumps.materials[0].image = MakeTexture(5 * texels / 2, texels, 3, 8, [](double x, double y, int c) {
    const Vec3 n = Vec3(0.5 * std::sin(x * 2 * kPi / 40), 0.4 * std::cos(y * 2 * kPi / 32), 1).normalized();
    return 0.5 + 0.5 * n[c];
  });
  models.push_back(std::move(bumps));
  return models;
}

MeshFile Opened(const std::string& glb) {
  return Must(ReadMeshBytes("model.glb", MeshFormat::kGlb, glb));
}

MeshFile WithNewMap(const MeshFile& file, const TextureOptions& textures) {
  const Triangulation triangles = Triangulate(file.mesh);
  const testing::InProcessMap map = testing::UnwrapInProcess(triangles.mesh, triangles.piece, true, true);
  if (!map.error.empty()) {
    std::cerr << map.error << "\n";
    std::abort();
  }
  OutputOptions options;
  options.path = "model.glb";
  options.format = MeshFormat::kGlb;
  options.textures = textures;
  options.textures.mode = TextureMode::kTransfer;
  const WrittenMesh written = Must(WriteMeshWithUv(file, UvOfPolygons(file.mesh, triangles, map.uv.data()), options));
  return Opened(written.files.back().bytes);
}

namespace {

// One triangle's look: its texture, UV (v downwards), and frames of its corners.
struct Look {
  std::size_t texture = 0;  // of LoadedModel::textures
  std::array<Vec2, 3> uv;
  std::array<Vec3, 3> normal;
  std::array<std::array<float, 4>, 3> tangent;
};

struct LoadedTexture {
  TextureImage image;
  bool is_normal = false, is_mirrored = false;

  std::vector<double> At(Vec2 uv) const {
    if (is_mirrored) {
      for (double& x : uv) {
        x -= 2 * std::floor(x / 2);
        if (x > 1) x = 2 - x;
      }
    }
    return is_normal ? Shown(image, uv) : ShownColor(image, uv);
  }
};

struct LoadedModel {
  std::vector<LoadedTexture> textures;  // one a material
  std::vector<Look> looks;              // one a triangle
};

LoadedModel Load(const MeshFile& file) {
  const GltfMesh& gltf = *file.gltf;
  const Json& json = gltf.document.json;
  LoadedModel model;
  for (const Json& material : json["materials"]) {
    LoadedTexture loaded;
    loaded.is_normal = material.contains("normalTexture");
    const Json& use =
        loaded.is_normal ? material["normalTexture"] : material["pbrMetallicRoughness"]["baseColorTexture"];
    const Json& texture = json["textures"][use["index"].get<std::size_t>()];
    loaded.is_mirrored = texture.contains("sampler") &&
                         json["samplers"][texture["sampler"].get<std::size_t>()].value("wrapS", 10497) == 33648;
    const Json& image = json["images"][texture["source"].get<std::size_t>()];
    loaded.image = Must(DecodeImage(Must(ViewBytes(gltf.document, image["bufferView"], "image")), "image"));
    model.textures.push_back(std::move(loaded));
  }
  for (const GltfPrimitive& primitive : gltf.primitives) {
    const Json& of = PrimitiveJson(json, primitive);
    bool are_given = false;
    const std::vector<float> normals = Must(CornerNormals(gltf, primitive, &are_given));
    const std::vector<float> given = Must(ReadVertexAttribute(gltf, primitive, "TANGENT", 4));
    TangentCorners corners;
    const auto first = static_cast<std::size_t>(3 * primitive.first_polygon);
    const auto count = static_cast<std::size_t>(3 * primitive.num_polygons);
    for (std::size_t c = 0; c < count; ++c) {
      const Vec3& p = file.mesh.positions[static_cast<std::size_t>(file.mesh.corner_vertex[first + c])];
      const Vec2& uv = file.mesh.texcoords[static_cast<std::size_t>(file.mesh.corner_texcoord[first + c])];
      corners.positions.push_back({static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())});
      corners.normals.push_back({normals[3 * c], normals[3 * c + 1], normals[3 * c + 2]});
      corners.uv.push_back({static_cast<float>(uv.x()), static_cast<float>(uv.y())});
    }
    std::vector<std::array<float, 4>> tangents;
    if (given.empty()) {
      tangents = ComputeTangents(corners);
    } else {
      for (std::size_t c = 0; c < count; ++c) {
        const auto v = 4 * static_cast<std::size_t>(gltf.corner_vertex[first + c]);
        tangents.push_back({given[v], given[v + 1], given[v + 2], given[v + 3]});
      }
    }
    for (std::size_t c = 0; c < count; c += 3) {
      Look look;
      look.texture = of["material"].get<std::size_t>();
      for (std::size_t k = 0; k < 3; ++k) {
        const std::array<float, 3>& n = corners.normals[c + k];
        look.uv[k] = Vec2(corners.uv[c + k][0], 1 - corners.uv[c + k][1]);
        look.normal[k] = Vec3(n[0], n[1], n[2]);
        look.tangent[k] = tangents[c + k];
      }
      model.looks.push_back(look);
    }
  }
  return model;
}

template <typename T>
T Blend(const std::array<T, 3>& corners, const std::array<double, 3>& w) {
  return T(w[0] * corners[0] + w[1] * corners[1] + w[2] * corners[2]);
}

Vec3 NormalOf(const Look& look, const std::array<double, 3>& w, const std::vector<double>& rgb) {
  const Vec3 normal = Blend(look.normal, w);
  Vec3 tangent = Vec3::Zero();
  for (std::size_t k = 0; k < 3; ++k)
    tangent += w[k] * Vec3(look.tangent[k][0], look.tangent[k][1], look.tangent[k][2]);
  const Vec3 bitangent = look.tangent[0][3] * normal.cross(tangent);
  return ((2 * rgb[0] / 255 - 1) * tangent + (2 * rgb[1] / 255 - 1) * bitangent + (2 * rgb[2] / 255 - 1) * normal)
      .normalized();
}

ModelDifference CompareLooks(const MeshFile& file, const LoadedModel& before, const LoadedModel& after, int points) {
  std::vector<double> areas;
  double total = 0;
  for (std::size_t f = 0; f < before.looks.size(); ++f) {
    std::array<Vec3, 3> p;
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = file.mesh.positions[static_cast<std::size_t>(file.mesh.corner_vertex[3 * f + k])];
    }
    areas.push_back(total += (p[1] - p[0]).cross(p[2] - p[0]).norm());
  }
  std::mt19937 random(7);
  const auto uniform = [&random] { return static_cast<double>(random() >> 4) / (1U << 28); };
  ModelDifference result;
  std::vector<double> differences;
  std::int64_t normals = 0;
  for (int i = 0; i < points; ++i) {
    const auto found = std::upper_bound(areas.begin(), areas.end(), uniform() * total);
    const auto f = std::min(areas.size() - 1, static_cast<std::size_t>(found - areas.begin()));
    double a = uniform(), b = uniform();
    if (a + b > 1) a = 1 - a, b = 1 - b;
    const std::array<double, 3> w = {1 - a - b, a, b};
    const Look &x = before.looks[f], &y = after.looks[f];
    const std::vector<double> old_rgb = before.textures[x.texture].At(Blend(x.uv, w));
    const std::vector<double> new_rgb = after.textures[y.texture].At(Blend(y.uv, w));
    ++result.points;
    if (before.textures[x.texture].is_normal) {
      const double cosine = NormalOf(x, w, old_rgb).dot(NormalOf(y, w, new_rgb));
      result.normal_mean_degrees += std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / kPi;
      ++normals;
      continue;
    }
    for (std::size_t c = 0; c < old_rgb.size(); ++c) differences.push_back(std::abs(old_rgb[c] - new_rgb[c]));
  }
  if (normals > 0) result.normal_mean_degrees /= static_cast<double>(normals);
  if (differences.empty()) return result;
  std::sort(differences.begin(), differences.end());
  for (const double d : differences) result.color.mean += d / static_cast<double>(differences.size());
  result.color.percentile99 = differences[differences.size() * 99 / 100];
  return result;
}

// An image of the size of after's texture `t`.
TextureImage ReferenceImage(const LoadedModel& before, const LoadedModel& after, std::size_t t) {
  const ImageHeader& header = after.textures[t].image.header;
  const auto width = static_cast<std::size_t>(header.width), height = static_cast<std::size_t>(header.height);
  std::vector<std::size_t> owner(width * height, before.looks.size());
  std::vector<double> distance(width * height, 1.5);  // texels beyond the owner's edges
  struct Frame {
    Vec2 origin, e1, e2;
    double area;
    std::array<double, 3> Weights(const Vec2& p) const {
      const Vec2 d = p - origin;
      const double a = (d.x() * e2.y() - d.y() * e2.x()) / area, b = (e1.x() * d.y() - e1.y() * d.x()) / area;
      return {1 - a - b, a, b};
    }
  };
  const auto frame_of = [&](std::size_t f) {
    std::array<Vec2, 3> p = after.looks[f].uv;
    for (Vec2& each : p) each = Vec2(each.x() * header.width, each.y() * header.height);
    const Vec2 e1 = p[1] - p[0], e2 = p[2] - p[0];
    return Frame{p[0], e1, e2, e1.x() * e2.y() - e1.y() * e2.x()};
  };
  for (std::size_t f = 0; f < after.looks.size(); ++f) {
    if (after.looks[f].texture != t) continue;
    const Frame frame = frame_of(f);
    const std::array<Vec2, 3> p = {frame.origin, Vec2(frame.origin + frame.e1), Vec2(frame.origin + frame.e2)};
    const auto [left, right] = std::minmax({p[0].x(), p[1].x(), p[2].x()});
    const auto [top, bottom] = std::minmax({p[0].y(), p[1].y(), p[2].y()});
    const std::array<double, 3> side = {(p[2] - p[1]).norm(), (p[0] - p[2]).norm(), (p[1] - p[0]).norm()};
    for (int y = std::max(0, static_cast<int>(top) - 2); y < std::min<double>(header.height, bottom + 2); ++y) {
      for (int x = std::max(0, static_cast<int>(left) - 2); x < std::min<double>(header.width, right + 2); ++x) {
        const std::array<double, 3> w = frame.Weights(Vec2(x + 0.5, y + 0.5));
        double beyond = 0;
        for (std::size_t k = 0; k < 3; ++k) beyond = std::max(beyond, -w[k] * std::abs(frame.area) / side[k]);
        const std::size_t at = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
        if (beyond >= distance[at]) continue;
        distance[at] = beyond;
        owner[at] = f;
      }
    }
  }
  TextureImage image = after.textures[t].image;
  for (std::size_t i = 0; i < owner.size(); ++i) {
    if (owner[i] == before.looks.size()) continue;
    const Look& old = before.looks[owner[i]];
    const Frame frame = frame_of(owner[i]);
    std::array<double, 3> sum = {};
    for (int k = 0; k < 64; ++k) {
      const Vec2 p(static_cast<double>(i % width) + (k % 8 + 0.5) / 8,
                   static_cast<double>(i / width) + (k / 8 + 0.5) / 8);
      const std::vector<double> shown = before.textures[old.texture].At(Blend(old.uv, frame.Weights(p)));
      for (std::size_t c = 0; c < 3; ++c) sum[c] += LinearOfSrgb(shown[c] / 255) / 64;
    }
    for (std::size_t c = 0; c < 3; ++c) {
      image.texels[3 * i + c] = static_cast<std::uint8_t>(std::lround(255 * SrgbOfLinear(std::min(1.0, sum[c]))));
    }
  }
  return Must(DecodeImage(Must(EncodeImage(image)), "reference"));
}

}  // namespace

namespace {

// The ball's surface in a direction.
Vec3 OnBall(const Vec3& direction) {
  const Vec3 d = direction.normalized();
  const double bumps = 0.03 * std::sin(9 * d.x()) * std::sin(8 * d.y() + 1) * std::cos(7 * d.z()) +
                       0.002 * std::sin(60 * d.x()) * std::cos(50 * d.y());
  return (1 + bumps) * d;
}

Vec3 BallNormal(const Vec3& direction) {
  const Vec3 d = direction.normalized();
  const Vec3 x = (std::abs(d.x()) < 0.7 ? Vec3(1, 0, 0) : Vec3(0, 1, 0)).cross(d).normalized(), y = d.cross(x);
  constexpr double kStep = 1e-4;
  return (OnBall(d + kStep * x) - OnBall(d - kStep * x))
      .cross(OnBall(d + kStep * y) - OnBall(d - kStep * y))
      .normalized();
}

double BallColor(const Vec3& direction, int channel) {
  const Vec3 d = direction.normalized();
  return 0.5 + 0.4 * std::sin(5 * d[channel] + 3 * d[(channel + 1) % 3]);
}

}  // namespace

std::string ScanPly(int detail) {
  std::string vertices, faces;
  std::uint32_t count = 0, polygons = 0;
  for (int side = 0; side < 6; ++side) {
    for (int j = 0; j <= detail; ++j) {
      for (int i = 0; i <= detail; ++i) {
        const Vec3 p = OnBall(OnCube(side, static_cast<double>(i) / detail, static_cast<double>(j) / detail));
        for (int k = 0; k < 3; ++k) Append(static_cast<float>(OnGrid(p[k])), &vertices);
        for (int k = 0; k < 3; ++k) vertices.push_back(static_cast<char>(std::lround(255 * BallColor(p, k))));
      }
    }
    const auto w = static_cast<std::uint32_t>(detail + 1);
    for (int j = 0; j < detail; ++j) {
      for (int i = 0; i < detail; ++i) {
        const std::uint32_t a = count + static_cast<std::uint32_t>(j) * w + static_cast<std::uint32_t>(i);
        for (const std::array<std::uint32_t, 3>& face :
             {std::array{a, a + w + 1, a + 1}, std::array{a, a + w, a + w + 1}}) {
          faces.push_back(3);
          for (const std::uint32_t v : face) Append(v, &faces);
          ++polygons;
        }
      }
    }
    count += w * w;
  }
  return "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(count) +
         "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty "
         "uchar blue\nelement face " +
         std::to_string(polygons) + "\nproperty list uchar uint vertex_indices\nend_header\n" + vertices + faces;
}

std::string DecimatedGlb(int detail) {
  SampleModel model = {"decimated", true, {}, {{MakeTexture(1, 1, 3, 8, [](double, double, int) { return 1; })}}};
  for (int side = 0; side < 6; ++side) {
    const auto place = [side](double x, double y) { return OnBall(OnCube(side, x, y)); };
    model.patches.push_back({place, detail, detail, 0, (side % 3 + 0.02) / 3, (side / 3 + 0.02) / 2, 0.96 / 3, 0.48});
  }
  return model.Glb();
}

ProjectionDifference CompareWithScan(const MeshFile& projected, int points) {
  const GltfMesh& gltf = *projected.gltf;
  std::array<TextureImage, 2> images;  // normals and colours
  for (std::size_t i = 0; i < 2; ++i) {
    const Json& view = gltf.document.json["images"][i]["bufferView"];
    images[i] = Must(DecodeImage(Must(ViewBytes(gltf.document, view, "image")), "image"));
  }
  const LoadedModel model = Load(projected);
  std::mt19937 random(3);
  const auto uniform = [&random] { return static_cast<double>(random() >> 4) / (1U << 28); };
  ProjectionDifference result;
  for (int i = 0; i < points; ++i) {
    const std::size_t f = random() % model.looks.size();
    double a = uniform(), b = uniform();
    if (a + b > 1) a = 1 - a, b = 1 - b;
    const std::array<double, 3> w = {1 - a - b, a, b};
    std::array<Vec3, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = projected.mesh.positions[static_cast<std::size_t>(projected.mesh.corner_vertex[3 * f + k])];
    }
    const Vec3 p = Blend(corners, w);
    const Vec2 uv = Blend(model.looks[f].uv, w);
    const double cosine = NormalOf(model.looks[f], w, Shown(images[0], uv)).dot(BallNormal(p));
    result.normal_mean_degrees += std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / kPi / points;
    const std::vector<double> rgb = ShownColor(images[1], uv);
    for (int c = 0; c < 3; ++c) {
      result.color_mean += std::abs(rgb[static_cast<std::size_t>(c)] - 255 * BallColor(p, c)) / 3 / points;
    }
  }
  return result;
}

ModelDifference CompareModels(const MeshFile& before, const MeshFile& after, int points) {
  return CompareLooks(before, Load(before), Load(after), points);
}

Difference ReferenceDifference(const MeshFile& before, const MeshFile& after, int points) {
  const LoadedModel old = Load(before);
  LoadedModel reference = Load(after);
  for (std::size_t t = 0; t < reference.textures.size(); ++t) {
    reference.textures[t].image = ReferenceImage(old, reference, t);
  }
  return CompareLooks(before, old, reference, points).color;
}

}  // namespace planish
