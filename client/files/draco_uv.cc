#include "client/files/draco_uv.h"

#include <algorithm>
#include <cstring>

namespace planish {

void ReplaceDracoUv(const CornerSplit& split, const std::vector<std::int32_t>& indices, std::int64_t old_uv,
                    DracoPoints* points) {
  std::erase_if(points->attributes,
                [&](const DracoAttribute& attribute) { return std::int64_t{attribute.unique_id} == old_uv; });
  std::uint32_t free_id = 0;
  for (DracoAttribute& attribute : points->attributes) {
    free_id = std::max(free_id, attribute.unique_id + 1);
    std::string values;
    values.reserve(split.source.size() * static_cast<std::size_t>(attribute.value_size));
    for (const std::int32_t source : split.source) {
      values.append(attribute.values, static_cast<std::size_t>(source * attribute.value_size),
                    static_cast<std::size_t>(attribute.value_size));
    }
    attribute.values = std::move(values);
  }
  DracoAttribute uv;
  uv.kind = DracoKind::kTexcoord;
  uv.unique_id = old_uv < 0 ? free_id : static_cast<std::uint32_t>(old_uv);
  uv.component = kDracoFloat32;
  uv.components = 2;
  uv.value_size = 2 * sizeof(float);
  for (const double value : split.uv) {
    const float rounded = static_cast<float>(value);
    char bytes[sizeof(float)];
    std::memcpy(bytes, &rounded, sizeof(float));
    uv.values.append(bytes, sizeof(float));
  }
  points->attributes.push_back(std::move(uv));
  points->num_points = split.num_vertices();
  for (std::size_t f = 0; f < points->faces.size(); ++f) {
    for (std::size_t k = 0; k < 3; ++k) points->faces[f][k] = indices[3 * f + k];
  }
}

}  // namespace planish
