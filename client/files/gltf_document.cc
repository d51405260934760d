#include "client/files/gltf_document.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <limits>

#include "absl/strings/escaping.h"
#include "client/files/file_io.h"
#include "client/files/gltf_meshopt.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

constexpr std::uint32_t kGlbMagic = 0x46546C67;  // "glTF"
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinChunk = 0x004E4942;
constexpr std::size_t kChunkHeader = 8;
// The JSON may be nested this deep; parsing and writing it are recursive.
constexpr int kDeepest = 200;

std::uint32_t LittleEndian32(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 4; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

void AppendLittleEndian32(std::uint64_t value, std::string* bytes) {
  for (int i = 0; i < 4; ++i) bytes->push_back(static_cast<char>(value >> (8 * i) & 0xFF));
}

struct Container {
  std::string_view json;
  std::optional<std::string_view> binary;
  std::string other_chunks;
};

absl::StatusOr<Container> TakeApart(const std::string& path, std::string_view bytes) {
  if (bytes.size() < 12) return FileMalformed(path, 0, "the GLB header is cut off");
  const std::uint32_t version = LittleEndian32(bytes, 4);
  if (version != 2) {
    return FileMalformed(path, 0, "GLB version " + std::to_string(version) + "; only glTF 2 can be read");
  }
  const std::uint64_t length = LittleEndian32(bytes, 8);
  if (length > bytes.size()) {
    return FileMalformed(path, 0,
                         "the header announces " + std::to_string(length) + " bytes, the file has " +
                             std::to_string(bytes.size()) + "; it is cut off");
  }
  bytes = bytes.substr(0, length);
  Container container;
  bool has_json = false;
  for (std::size_t at = 12; at < bytes.size();) {
    if (bytes.size() - at < kChunkHeader) return FileMalformed(path, 0, "a chunk of the GLB is cut off");
    const std::uint64_t size = LittleEndian32(bytes, at);
    const std::uint32_t type = LittleEndian32(bytes, at + 4);
    if (size > bytes.size() - at - kChunkHeader) return FileMalformed(path, 0, "a chunk of the GLB is cut off");
    const std::string_view data = bytes.substr(at + kChunkHeader, size);
    if (!has_json) {
      if (type != kJsonChunk) return FileMalformed(path, 0, "the first chunk of the GLB is not its JSON");
      container.json = data;
      has_json = true;
    } else if (type == kBinChunk && !container.binary) {
      container.binary = data;
    } else {
      container.other_chunks += bytes.substr(at, kChunkHeader + size);
    }
    at += kChunkHeader + size;
  }
  if (!has_json) return FileMalformed(path, 0, "the GLB has no chunks");
  return container;
}

absl::StatusOr<Json> ParseJson(const std::string& path, std::string_view text) {
  bool too_deep = false;
  const auto watch = [&too_deep](int depth, Json::parse_event_t, Json&) {
    too_deep |= depth > kDeepest;
    return !too_deep;
  };
  try {
    Json json = Json::parse(text.begin(), text.end(), watch);
    if (too_deep) return FileMalformed(path, 0, "the JSON is nested too deeply");
    if (!json.is_object()) return FileMalformed(path, 0, "the JSON is no object");
    return json;
  } catch (const Json::exception& error) {
    return FileMalformed(path, 0, std::string("the JSON is damaged: ") + error.what());
  }
}

// Blanks per level of the JSON, as Json::dump() takes them: those at the start of its second line; 2 if that line does
// not start with blanks; -1 if there is no second line.
int IndentOf(std::string_view json) {
  const std::size_t line = json.find('\n');
  if (line == std::string_view::npos) return -1;
  const std::size_t text = json.find_first_not_of(' ', line + 1);
  return text == std::string_view::npos || text == line + 1 ? 2 : static_cast<int>(text - line - 1);
}

absl::Status CheckVersion(const GltfDocument& document) {
  const Json* const asset = GltfObject(document.json, "asset");
  const auto version = asset == nullptr ? Json() : asset->value("version", Json());
  if (!version.is_string()) return GltfFault(document, "asset.version", "a glTF file must have it");
  const std::string text = version.get<std::string>();
  if (text.rfind("2.", 0) != 0) {
    return GltfFault(document, "asset.version", Quoted(text) + "; only glTF 2 can be read");
  }
  return absl::OkStatus();
}

// Lists of the root that are there must be lists: of objects, and of the names of extensions.
absl::Status CheckLists(const GltfDocument& document) {
  for (const char* key : {"accessors", "animations", "bufferViews", "buffers", "cameras", "images", "materials",
                          "meshes", "nodes", "samplers", "scenes", "skins", "textures"}) {
    const Json& list = GltfArray(document, key);
    if (!list.is_array()) return GltfFault(document, key, "not an array");
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (!list[i].is_object()) {
        return GltfFault(document, std::string(key) + "[" + std::to_string(i) + "]", "not an object");
      }
    }
  }
  for (const char* key : {"extensionsUsed", "extensionsRequired"}) {
    const auto names = document.json.find(key);
    if (names == document.json.end()) continue;
    const bool are_names = names->is_array() &&
                           std::all_of(names->begin(), names->end(), [](const Json& name) { return name.is_string(); });
    if (!are_names) return GltfFault(document, key, "not an array of names");
  }
  return absl::OkStatus();
}

absl::Status LoadBuffers(const std::optional<std::string_view>& binary, GltfDocument* document) {
  const Json& buffers = GltfArray(*document, "buffers");
  for (std::size_t i = 0; i < buffers.size(); ++i) {
    const Json& buffer = buffers[i];
    const std::string element = "buffers[" + std::to_string(i) + "]";
    PLANISH_ASSIGN_OR_RETURN(const std::int64_t length,
                             GltfInt(*document, buffer, element, "byteLength", 0, kLargestGltfInt, std::nullopt));
    const auto uri = buffer.find("uri");
    std::string data;
    if (uri == buffer.end()) {
      // The first buffer of a GLB has its data in the BIN chunk; other buffers without a URI are placeholders.
      if (i == 0 && binary) data = std::string(*binary);
      if (i != 0 || !binary) {
        document->buffers.emplace_back();
        continue;
      }
    } else {
      if (!uri->is_string()) return GltfFault(*document, element + ".uri", "not a string");
      PLANISH_ASSIGN_OR_RETURN(data, LoadGltfUri(*document, element + ".uri", uri->get<std::string>(), length));
    }
    if (static_cast<std::int64_t>(data.size()) < length) {
      return GltfFault(*document, element,
                       "byteLength is " + std::to_string(length) + ", but there are " + std::to_string(data.size()) +
                           " bytes; the file seems to be cut off");
    }
    data.resize(length);
    document->num_bytes += length;
    document->buffers.push_back(std::move(data));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<GltfDocument> ParseGltf(const std::string& path, std::string_view bytes) {
  if (bytes.empty()) return FileMalformed(path, 0, "the file is empty");
  GltfDocument document;
  document.path = path;
  document.num_bytes = static_cast<std::int64_t>(bytes.size());
  Container container;
  container.json = bytes;
  document.is_binary = bytes.size() >= 4 && LittleEndian32(bytes, 0) == kGlbMagic;
  if (document.is_binary) {
    PLANISH_ASSIGN_OR_RETURN(container, TakeApart(path, bytes));
    document.other_chunks = container.other_chunks;
  }
  PLANISH_ASSIGN_OR_RETURN(document.json, ParseJson(path, container.json));
  document.indent = IndentOf(container.json);
  PLANISH_RETURN_IF_ERROR(CheckVersion(document));
  PLANISH_RETURN_IF_ERROR(CheckLists(document));
  PLANISH_RETURN_IF_ERROR(LoadBuffers(container.binary, &document));
  PLANISH_RETURN_IF_ERROR(DecompressMeshopt(&document));
  return document;
}

absl::Status GltfFault(const GltfDocument& document, const std::string& element, const std::string& message) {
  return MakeError(absl::StatusCode::kInvalidArgument, "FILE_MALFORMED",
                   document.path + ": " + element + ": " + message, {{"path", document.path}, {"element", element}});
}

const Json& GltfArray(const GltfDocument& document, const char* key) {
  static const auto* const empty = new Json(Json::array());
  const auto array = document.json.find(key);
  return array == document.json.end() ? *empty : *array;
}

absl::StatusOr<std::int64_t> GltfInt(const GltfDocument& document, const Json& object, const std::string& element,
                                     const char* key, std::int64_t least, std::int64_t most,
                                     std::optional<std::int64_t> fallback) {
  const auto found = object.find(key);
  const std::string name = element + "." + key;
  if (found == object.end()) {
    if (fallback) return *fallback;
    return GltfFault(document, name, "missing");
  }
  const std::string range = "must be a whole number in [" + std::to_string(least) + ", " + std::to_string(most) + "]";
  if (!found->is_number()) return GltfFault(document, name, range);
  // Some writers put 3.0 for 3.
  const double value = found->get<double>();
  if (!(value >= static_cast<double>(least)) || !(value <= static_cast<double>(most)) || value != std::floor(value)) {
    return GltfFault(document, name, found->dump() + ": " + range);
  }
  return static_cast<std::int64_t>(value);
}

absl::StatusOr<std::int64_t> GltfIndex(const GltfDocument& document, const Json& value, const std::string& element,
                                       std::int64_t count) {
  if (!value.is_number_integer()) return GltfFault(document, element, "not an index");
  // Compared as unsigned, so that a number too large for a signed type is not mistaken for a small one.
  if ((!value.is_number_unsigned() && value.get<std::int64_t>() < 0) ||
      value.get<std::uint64_t>() >= static_cast<std::uint64_t>(count)) {
    return GltfFault(document, element, "index " + value.dump() + ", but there are " + std::to_string(count));
  }
  return value.get<std::int64_t>();
}

const Json* GltfObject(const Json& object, const char* key) {
  const auto found = object.find(key);
  return found == object.end() || !found->is_object() ? nullptr : &*found;
}

std::int64_t GltfIntAt(const Json& object, const char* key, std::int64_t otherwise) {
  const auto found = object.find(key);
  return found == object.end() || !found->is_number_integer() ? otherwise : found->get<std::int64_t>();
}

double GltfNumberAt(const Json& root, const Json::json_pointer& at, double otherwise) {
  constexpr double kLargest = std::numeric_limits<float>::max();
  if (!root.contains(at) || !root[at].is_number()) return otherwise;
  return std::clamp(root[at].get<double>(), -kLargest, kLargest);
}

std::string GltfName(const Json& object, const char* kind, std::int64_t index) {
  const auto name = object.find("name");
  if (name != object.end() && name->is_string() && !name->get_ref<const std::string&>().empty()) {
    return name->get<std::string>();
  }
  return std::string(kind) + "_" + std::to_string(index);
}

absl::StatusOr<std::string> GlbBytes(const Json& json, std::string buffer, const std::string& other_chunks) {
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::size_t padding = (4 - buffer.size() % 4) % 4;
  std::uint64_t size = 12 + kChunkHeader + text.size() + other_chunks.size();
  if (!buffer.empty()) size += kChunkHeader + buffer.size() + padding;
  if (size > std::numeric_limits<std::uint32_t>::max()) {
    return MakeError(absl::StatusCode::kResourceExhausted, "FILE_TOO_LARGE",
                     "a GLB cannot be larger than 4 GiB; write .gltf instead");
  }
  std::string head;
  AppendLittleEndian32(kGlbMagic, &head);
  AppendLittleEndian32(2, &head);
  AppendLittleEndian32(size, &head);
  AppendLittleEndian32(text.size(), &head);
  AppendLittleEndian32(kJsonChunk, &head);
  head += text;
  if (!buffer.empty()) {
    AppendLittleEndian32(buffer.size() + padding, &head);
    AppendLittleEndian32(kBinChunk, &head);
    buffer.append(padding, '\0');
  }
  buffer.insert(0, head);
  buffer += other_chunks;
  return buffer;
}

namespace {

bool IsHex(char c) {
  return std::isxdigit(static_cast<unsigned char>(c)) != 0;
}

// Turns "%20" into " "; a '%' before anything but two hex digits stays.
std::string Decoded(std::string_view uri) {
  std::string text;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] == '%' && i + 2 < uri.size() && IsHex(uri[i + 1]) && IsHex(uri[i + 2])) {
      text += absl::HexStringToBytes(std::string(uri.substr(i + 1, 2)));
      i += 2;
    } else {
      text += uri[i];
    }
  }
  return text;
}

// Whether a URI begins with a scheme such as "https:". A drive letter ("C:") counts too, as it is not portable either.
bool HasScheme(std::string_view uri) {
  const std::size_t colon = uri.find(':');
  return colon != std::string_view::npos && colon > 0 && uri.substr(0, colon).find_first_of("/?#%") == uri.npos;
}

bool IsRelative(std::string_view uri) {
  return !uri.empty() && !HasScheme(uri) && uri.front() != '/' && uri.front() != '\\';
}

}  // namespace

bool IsDataUri(std::string_view uri) {
  return uri.substr(0, 5) == "data:";
}

std::string DataUri(const std::string& bytes) {
  return "data:application/octet-stream;base64," + absl::Base64Escape(bytes);
}

absl::StatusOr<std::string> FileOfUri(const GltfDocument& document, const std::string& element,
                                      const std::string& uri) {
  if (IsRelative(uri)) return Decoded(uri);
  return MakeError(absl::StatusCode::kInvalidArgument, "FILE_UNSUPPORTED",
                   document.path + ": " + element + ": only data URIs and files beside this one can be read",
                   {{"path", document.path}, {"element", element}});
}

absl::StatusOr<std::string> LoadGltfUri(const GltfDocument& document, const std::string& element,
                                        const std::string& uri, std::int64_t size) {
  if (IsDataUri(uri)) {
    const std::size_t comma = uri.find(',');
    if (comma == std::string::npos) return GltfFault(document, element, "a data URI needs a comma");
    const std::string_view head = std::string_view(uri).substr(0, comma);
    const std::string_view body = std::string_view(uri).substr(comma + 1);
    if (head.size() < 7 || head.substr(head.size() - 7) != ";base64") return Decoded(body);
    std::string bytes;
    if (!absl::Base64Unescape(std::string(body), &bytes))
      return GltfFault(document, element, "the base64 text is damaged");
    return bytes;
  }
  PLANISH_ASSIGN_OR_RETURN(const std::string file, FileOfUri(document, element, uri));
  return ReadFileStart((std::filesystem::path(document.path).parent_path() / file).string(), size);
}

std::string MovedUri(const std::string& uri, const std::string& from, const std::string& to) {
  if (!IsRelative(uri)) return uri;
  namespace fs = std::filesystem;
  const fs::path source = fs::absolute(from).lexically_normal().parent_path();
  const fs::path target = fs::absolute(to).lexically_normal().parent_path();
  if (source == target) return uri;
  const fs::path moved = (source / Decoded(uri)).lexically_normal().lexically_relative(target);
  return moved.empty() ? uri : UriOfFileName(moved.generic_string());
}

std::string UriOfFileName(const std::string& name) {
  std::string uri;
  for (const char c : name) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) != 0 ||
                          std::string_view("-._~/!$&'()*+,;=@").find(c) != std::string_view::npos;
    if (is_plain) {
      uri += c;
    } else {
      uri += "%" + absl::BytesToHexString(std::string(1, c));
    }
  }
  return uri;
}

}  // namespace planish
