// Ids for values: equal ones share an id.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

// Numbers triples of doubles in the order of their first appearance. Equal means to the bit, except that 0 and -0 are
// the same; a NaN equals itself.
class ValueIndex {
 public:
  void Reserve(std::size_t count) { ids_.reserve(count); }
  // The id of `value`: new ones get the number of ids so far. Fewer than 2^31 values.
  std::int32_t Add(const Vec3& value);
  std::int32_t size() const { return static_cast<std::int32_t>(ids_.size()); }

 private:
  using Key = std::array<std::uint64_t, 3>;
  struct Hash {
    std::size_t operator()(const Key& key) const;
  };
  std::unordered_map<Key, std::int32_t, Hash> ids_;
};

// PolygonMesh::texcoords: one entry per different value.
class TexcoordTable {
 public:
  // The id of (u, v), v upwards.
  std::int32_t Add(double u, double v);
  std::vector<Vec2> TakeValues() { return std::move(values_); }

 private:
  ValueIndex ids_;
  std::vector<Vec2> values_;
};

}  // namespace planish
