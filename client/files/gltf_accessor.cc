#include "client/files/gltf_accessor.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "core/base/status_macros.h"

namespace planish {
namespace {

// Values are copied with memcpy, which needs a little-endian machine.
static_assert(std::endian::native == std::endian::little);

template <typename T>
T Load(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(value));
  return value;
}

struct View {
  std::string_view bytes;
  std::int64_t stride = 0;  // 0: none given
};

absl::StatusOr<View> OpenView(const GltfDocument& document, const Json& index, const std::string& user) {
  const Json& views = GltfArray(document, "bufferViews");
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t i,
                           GltfIndex(document, index, user, static_cast<std::int64_t>(views.size())));
  const Json& view = views[static_cast<std::size_t>(i)];
  const std::string element = "bufferViews[" + std::to_string(i) + "]";
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t buffer,
                           GltfInt(document, view, element, "buffer", 0,
                                   static_cast<std::int64_t>(document.buffers.size()) - 1, std::nullopt));
  const std::string& bytes = document.buffers[static_cast<std::size_t>(buffer)];
  const std::int64_t size = static_cast<std::int64_t>(bytes.size());
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t offset, GltfInt(document, view, element, "byteOffset", 0, size, 0));
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t length,
                           GltfInt(document, view, element, "byteLength", 0, size - offset, std::nullopt));
  View result;
  PLANISH_ASSIGN_OR_RETURN(result.stride, GltfInt(document, view, element, "byteStride", 0, 65536, 0));
  result.bytes = std::string_view(bytes).substr(static_cast<std::size_t>(offset), static_cast<std::size_t>(length));
  return result;
}

struct Shape {
  const char* name;
  int columns;
  int rows;
};

absl::Status ReadShape(const GltfDocument& document, const Json& json, GltfAccessor* accessor) {
  static constexpr Shape kShapes[] = {{"SCALAR", 1, 1}, {"VEC2", 1, 2}, {"VEC3", 1, 3}, {"VEC4", 1, 4},
                                      {"MAT2", 2, 2},   {"MAT3", 3, 3}, {"MAT4", 4, 4}};
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t component,
                           GltfInt(document, json, accessor->element, "componentType", 5120, 5126, std::nullopt));
  if (component == 5124) return GltfFault(document, accessor->element + ".componentType", "5124 is not allowed");
  accessor->component = static_cast<GltfComponent>(component);
  const auto normalized = json.find("normalized");
  accessor->normalized = normalized != json.end() && *normalized == true;
  const auto type = json.find("type");
  for (const Shape& shape : kShapes) {
    if (type == json.end() || *type != shape.name) continue;
    accessor->components = shape.columns * shape.rows;
    const int column = shape.rows * ComponentSize(accessor->component);
    accessor->element_size = shape.columns == 1 ? column : shape.columns * ((column + 3) / 4 * 4);
    return absl::OkStatus();
  }
  return GltfFault(document, accessor->element + ".type", "must be SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4");
}

// Finds the `count` elements of `size` bytes at the byteOffset and bufferView of `json`, and sets *stride. `stride`
// null: there are no gaps between the elements. FILE_MALFORMED if they do not fit into the view.
absl::StatusOr<const char*> Elements(const GltfDocument& document, const Json& json, const std::string& element,
                                     std::int64_t count, std::int64_t size, std::int64_t* stride) {
  PLANISH_ASSIGN_OR_RETURN(const View view, OpenView(document, json.at("bufferView"), element + ".bufferView"));
  const std::int64_t length = static_cast<std::int64_t>(view.bytes.size());
  const std::int64_t step = stride == nullptr || view.stride == 0 ? size : view.stride;
  if (step < size) {
    return GltfFault(
        document, element,
        "elements of " + std::to_string(size) + " bytes in a view with byteStride " + std::to_string(step));
  }
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t offset, GltfInt(document, json, element, "byteOffset", 0, length, 0));
  // Divides instead of multiplying, since counts may be arbitrarily large.
  const bool fits = count == 0 || (length - offset >= size && (length - offset - size) / step >= count - 1);
  if (!fits) {
    return GltfFault(
        document, element,
        std::to_string(count) + " elements do not fit into the " + std::to_string(length) + " bytes of its bufferView");
  }
  if (stride != nullptr) *stride = step;
  return view.bytes.data() + offset;
}

absl::Status ReadSparse(const GltfDocument& document, const Json& sparse, GltfAccessor* accessor) {
  const std::string element = accessor->element + ".sparse";
  PLANISH_ASSIGN_OR_RETURN(accessor->sparse_count,
                           GltfInt(document, sparse, element, "count", 0, accessor->count, std::nullopt));
  const Json* const indices = GltfObject(sparse, "indices");
  const Json* const values = GltfObject(sparse, "values");
  if (indices == nullptr || !indices->contains("bufferView")) return GltfFault(document, element, "no indices");
  if (values == nullptr || !values->contains("bufferView")) return GltfFault(document, element, "no values");
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t component, GltfInt(document, *indices, element + ".indices",
                                                                 "componentType", 5121, 5125, std::nullopt));
  if (component % 2 == 0) return GltfFault(document, element + ".indices.componentType", "must be unsigned");
  accessor->sparse_component = static_cast<GltfComponent>(component);
  const int index_size = ComponentSize(accessor->sparse_component);
  PLANISH_ASSIGN_OR_RETURN(accessor->sparse_indices, Elements(document, *indices, element + ".indices",
                                                              accessor->sparse_count, index_size, nullptr));
  PLANISH_ASSIGN_OR_RETURN(accessor->sparse_values, Elements(document, *values, element + ".values",
                                                             accessor->sparse_count, accessor->element_size, nullptr));
  std::int64_t last = -1;
  for (std::int64_t i = 0; i < accessor->sparse_count; ++i) {
    const std::int64_t index = IndexValue(accessor->sparse_indices + i * index_size, accessor->sparse_component);
    if (index <= last || index >= accessor->count) {
      return GltfFault(document, element + ".indices",
                       "they must ascend below " + std::to_string(accessor->count) + ", but " + std::to_string(index) +
                           " follows " + std::to_string(last));
    }
    last = index;
  }
  return absl::OkStatus();
}

}  // namespace

int ComponentSize(GltfComponent component) {
  switch (component) {
    case GltfComponent::kByte:
    case GltfComponent::kUbyte:
      return 1;
    case GltfComponent::kShort:
    case GltfComponent::kUshort:
      return 2;
    case GltfComponent::kUint:
    case GltfComponent::kFloat:
      return 4;
  }
  return 4;
}

absl::StatusOr<GltfAccessor> OpenAccessor(const GltfDocument& document, std::int64_t index) {
  const Json& accessors = GltfArray(document, "accessors");
  const Json& json = accessors[static_cast<std::size_t>(index)];
  GltfAccessor accessor;
  accessor.element = "accessors[" + std::to_string(index) + "]";
  PLANISH_RETURN_IF_ERROR(ReadShape(document, json, &accessor));
  PLANISH_ASSIGN_OR_RETURN(accessor.count,
                           GltfInt(document, json, accessor.element, "count", 0, kLargestGltfInt, std::nullopt));
  if (json.contains("bufferView")) {
    PLANISH_ASSIGN_OR_RETURN(accessor.data, Elements(document, json, accessor.element, accessor.count,
                                                     accessor.element_size, &accessor.stride));
  } else if (accessor.count > document.num_bytes) {
    // All elements are zero. They take no bytes in the file, but memory here, so their number is limited.
    return GltfFault(document, accessor.element + ".count",
                     std::to_string(accessor.count) + " elements without data, in a file of " +
                         std::to_string(document.num_bytes) + " bytes");
  }
  if (const Json* const sparse = GltfObject(json, "sparse")) {
    PLANISH_RETURN_IF_ERROR(ReadSparse(document, *sparse, &accessor));
  }
  return accessor;
}

absl::StatusOr<std::string_view> ViewBytes(const GltfDocument& document, const Json& index,
                                           const std::string& element) {
  PLANISH_ASSIGN_OR_RETURN(const View view, OpenView(document, index, element));
  return view.bytes;
}

std::string GltfAccessor::DenseBytes() const {
  std::string bytes(static_cast<std::size_t>(count * element_size), '\0');
  if (data != nullptr) {
    for (std::int64_t i = 0; i < count; ++i) {
      std::memcpy(bytes.data() + i * element_size, data + i * stride, static_cast<std::size_t>(element_size));
    }
  }
  const int index_size = ComponentSize(sparse_component);
  for (std::int64_t i = 0; i < sparse_count; ++i) {
    const std::int64_t index = IndexValue(sparse_indices + i * index_size, sparse_component);
    std::memcpy(bytes.data() + index * element_size, sparse_values + i * element_size,
                static_cast<std::size_t>(element_size));
  }
  return bytes;
}

double ComponentValue(const char* bytes, GltfComponent component, bool normalized) {
  switch (component) {
    case GltfComponent::kByte:
      return normalized ? std::max(Load<std::int8_t>(bytes) / 127.0, -1.0) : Load<std::int8_t>(bytes);
    case GltfComponent::kUbyte:
      return Load<std::uint8_t>(bytes) / (normalized ? 255.0 : 1.0);
    case GltfComponent::kShort:
      return normalized ? std::max(Load<std::int16_t>(bytes) / 32767.0, -1.0) : Load<std::int16_t>(bytes);
    case GltfComponent::kUshort:
      return Load<std::uint16_t>(bytes) / (normalized ? 65535.0 : 1.0);
    case GltfComponent::kUint:
      return Load<std::uint32_t>(bytes);
    case GltfComponent::kFloat:
      return Load<float>(bytes);
  }
  return 0;
}

std::int64_t IndexValue(const char* bytes, GltfComponent component) {
  switch (component) {
    case GltfComponent::kUbyte:
      return Load<std::uint8_t>(bytes);
    case GltfComponent::kUshort:
      return Load<std::uint16_t>(bytes);
    default:
      return Load<std::uint32_t>(bytes);
  }
}

void AppendIndex(std::int64_t value, GltfComponent component, std::string* bytes) {
  for (int i = 0; i < ComponentSize(component); ++i) bytes->push_back(static_cast<char>(value >> (8 * i) & 0xFF));
}

}  // namespace planish
