#include "client/files/gltf_meshopt.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

constexpr std::array<const char*, 2> kExtensions = {"EXT_meshopt_compression", "KHR_meshopt_compression"};
constexpr std::int64_t kViewAlignment = 8;
// Per mode of compression: the high four bits of a stream's first byte, and the latest version, in the low four bits,
// that meshoptimizer 0.18 decodes.
struct Codec {
  const char* mode;
  unsigned char header, version;
};
constexpr std::array<Codec, 3> kCodecs = {{{"ATTRIBUTES", 0xa0, 0}, {"TRIANGLES", 0xe0, 1}, {"INDICES", 0xd0, 1}}};
// Most decoded bytes per compressed byte: two bits encode 16 bytes at best. So a small file cannot claim much memory.
constexpr std::int64_t kMostPerByte = 64;

// A view's compression parameters.
struct Compressed {
  std::string mode, filter;
  std::int64_t count = 0, stride = 0, offset = 0, length = 0, buffer = 0;
};

bool HasRightStride(const Compressed& view) {
  if (view.mode != "ATTRIBUTES") return view.stride == 2 || view.stride == 4;
  if (view.filter == "OCTAHEDRAL" || view.filter == "COLOR") return view.stride == 4 || view.stride == 8;
  if (view.filter == "QUATERNION") return view.stride == 8;
  return view.stride % 4 == 0;
}

absl::StatusOr<Compressed> ReadView(const GltfDocument& document, const Json& json, const std::string& element) {
  Compressed view;
  const auto text = [&json](const char* key, const char* otherwise) {
    const auto found = json.find(key);
    return found != json.end() && found->is_string() ? found->get<std::string>() : std::string(otherwise);
  };
  view.mode = text("mode", "");
  view.filter = text("filter", "NONE");
  const auto number = [&](const char* key, std::int64_t least, std::int64_t most,
                          std::optional<std::int64_t> fallback) {
    return GltfInt(document, json, element, key, least, most, fallback);
  };
  const auto buffers = static_cast<std::int64_t>(document.buffers.size());
  PLANISH_ASSIGN_OR_RETURN(view.buffer, number("buffer", 0, buffers - 1, std::nullopt));
  const auto size = static_cast<std::int64_t>(document.buffers[static_cast<std::size_t>(view.buffer)].size());
  PLANISH_ASSIGN_OR_RETURN(view.offset, number("byteOffset", 0, size, 0));
  PLANISH_ASSIGN_OR_RETURN(view.length, number("byteLength", 0, size - view.offset, std::nullopt));
  PLANISH_ASSIGN_OR_RETURN(view.stride, number("byteStride", 1, 256, std::nullopt));
  const std::int64_t most = kMostPerByte * (view.length + 1) / view.stride;
  PLANISH_ASSIGN_OR_RETURN(view.count, number("count", 0, most, std::nullopt));
  if (view.mode != "ATTRIBUTES" && view.mode != "TRIANGLES" && view.mode != "INDICES") {
    return GltfFault(document, element + ".mode", "must be ATTRIBUTES, TRIANGLES or INDICES");
  }
  const bool is_known = view.filter == "NONE" || view.filter == "COLOR" || view.filter == "OCTAHEDRAL" ||
                        view.filter == "QUATERNION" || view.filter == "EXPONENTIAL";
  if (!is_known || (view.mode != "ATTRIBUTES" && view.filter != "NONE")) {
    return GltfFault(document, element + ".filter", "must be NONE, or for ATTRIBUTES one that the extension names");
  }
  if (!HasRightStride(view)) return GltfFault(document, element + ".byteStride", "does not go with mode and filter");
  if (view.mode == "TRIANGLES" && view.count % 3 != 0) {
    return GltfFault(document, element + ".count", "no whole number of triangles");
  }
  return view;
}

// Whether the stream's version or filter is too new for meshoptimizer 0.18.
bool IsTooNew(const GltfDocument& document, const Compressed& view) {
  if (view.filter == "COLOR") return true;
  if (view.length == 0) return false;
  const std::string& buffer = document.buffers[static_cast<std::size_t>(view.buffer)];
  const auto first = static_cast<unsigned char>(buffer[static_cast<std::size_t>(view.offset)]);
  return std::any_of(kCodecs.begin(), kCodecs.end(), [&](const Codec& codec) {
    return view.mode == codec.mode && (first & 0xf0) == codec.header && (first & 0x0f) > codec.version;
  });
}

// Whether the file also has the view's bytes uncompressed.
bool HasFallback(const GltfDocument& document, const Json& view, const std::string& name) {
  const auto required = document.json.find("extensionsRequired");
  const bool is_required = required != document.json.end() && required->is_array() &&
                           std::find(required->begin(), required->end(), Json(name)) != required->end();
  const auto buffer = view.find("buffer");
  return !is_required && buffer != view.end() && buffer->is_number_unsigned() &&
         buffer->get<std::size_t>() < document.buffers.size() && !document.buffers[buffer->get<std::size_t>()].empty();
}

absl::StatusOr<std::string> Decompress(const GltfDocument& document, const Compressed& view,
                                       const std::string& element) {
  const auto count = static_cast<std::size_t>(view.count), stride = static_cast<std::size_t>(view.stride);
  const auto length = static_cast<std::size_t>(view.length);
  const std::string& buffer = document.buffers[static_cast<std::size_t>(view.buffer)];
  const auto* const bytes = reinterpret_cast<const unsigned char*>(buffer.data()) + view.offset;
  std::string result(count * stride, '\0');
  int fault = 0;
  if (view.mode == "ATTRIBUTES") {
    fault = meshopt_decodeVertexBuffer(result.data(), count, stride, bytes, length);
  } else if (view.mode == "TRIANGLES") {
    fault = meshopt_decodeIndexBuffer(result.data(), count, stride, bytes, length);
  } else {
    fault = meshopt_decodeIndexSequence(result.data(), count, stride, bytes, length);
  }
  if (fault != 0) return GltfFault(document, element, "the compressed data are damaged");
  if (view.filter == "OCTAHEDRAL") meshopt_decodeFilterOct(result.data(), count, stride);
  if (view.filter == "QUATERNION") meshopt_decodeFilterQuat(result.data(), count, stride);
  if (view.filter == "EXPONENTIAL") meshopt_decodeFilterExp(result.data(), count, stride);
  return result;
}

// Removes the extension from an object of the document.
void TakeOut(const char* name, Json* object) {
  if (GltfObject(*object, "extensions") == nullptr) return;
  Json& extensions = (*object)["extensions"];
  extensions.erase(name);
  if (extensions.empty()) object->erase("extensions");
}

absl::Status DecompressViews(const char* name, GltfDocument* document) {
  const Json& views = GltfArray(*document, "bufferViews");
  const Json& buffers = GltfArray(*document, "buffers");
  std::string decoded;
  bool any = false;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Json* const extensions = GltfObject(views[i], "extensions");
    const Json* const json = extensions == nullptr ? nullptr : GltfObject(*extensions, name);
    if (json == nullptr) continue;
    any = true;
    const std::string element = "bufferViews[" + std::to_string(i) + "].extensions." + name;
    PLANISH_ASSIGN_OR_RETURN(const Compressed compressed, ReadView(*document, *json, element));
    Json& view = document->json["bufferViews"][i];
    if (IsTooNew(*document, compressed)) {
      if (HasFallback(*document, view, name)) {
        TakeOut(name, &view);
        continue;
      }
      return MakeError(absl::StatusCode::kInvalidArgument, "FILE_UNSUPPORTED",
                       document->path + ": " + element +
                           ": this stream is of a newer version than meshoptimizer 0.18 can decode; gltfpack -noq -i " +
                           "IN.glb -o OUT.glb, of the version that wrote it, makes a file without compression",
                       {{"path", document->path}, {"element", element}});
    }
    PLANISH_ASSIGN_OR_RETURN(const std::string bytes, Decompress(*document, compressed, element));
    decoded.resize((decoded.size() + kViewAlignment - 1) / kViewAlignment * kViewAlignment, '\0');
    TakeOut(name, &view);
    view["buffer"] = buffers.size();
    view["byteOffset"] = decoded.size();
    view["byteLength"] = bytes.size();
    decoded += bytes;
  }
  if (!any) return absl::OkStatus();
  for (Json& buffer : document->json["buffers"]) TakeOut(name, &buffer);
  document->json["buffers"].push_back({{"byteLength", decoded.size()}});
  document->num_bytes += static_cast<std::int64_t>(decoded.size());
  document->buffers.push_back(std::move(decoded));
  for (const char* key : {"extensionsUsed", "extensionsRequired"}) {
    const auto names = document->json.find(key);
    if (names == document->json.end() || !names->is_array()) continue;
    names->erase(std::remove(names->begin(), names->end(), Json(name)), names->end());
    if (names->empty()) document->json.erase(key);
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status DecompressMeshopt(GltfDocument* document) {
  for (const char* name : kExtensions) PLANISH_RETURN_IF_ERROR(DecompressViews(name, document));
  return absl::OkStatus();
}

}  // namespace planish
