#include "core/io/value_index.h"

#include <bit>

namespace planish {

std::size_t ValueIndex::Hash::operator()(const Key& key) const {
  std::uint64_t hash = 0;
  for (const std::uint64_t word : key) {
    hash = (hash ^ word) * 0x9E3779B97F4A7C15u;
    hash ^= hash >> 32;
  }
  return hash;
}

std::int32_t ValueIndex::Add(const Vec3& value) {
  Key key;
  for (int axis = 0; axis < 3; ++axis) key[axis] = std::bit_cast<std::uint64_t>(value[axis] + 0.0);
  return ids_.emplace(key, size()).first->second;
}

std::int32_t TexcoordTable::Add(double u, double v) {
  const std::int32_t id = ids_.Add(Vec3(u, v, 0));
  if (id == static_cast<std::int32_t>(values_.size())) values_.emplace_back(u, v);
  return id;
}

}  // namespace planish
