// Members of the library's structs as JSON, under the names that their fields have in the proto.
#pragma once

#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "client/cli/results.h"
#include "client/cli/text.h"
#include "made/fields.h"
#include "planish/types.h"

namespace planish::cli {

template <typename Struct>
Json FieldsJson(const Struct& value);

inline Json FieldJson(const Field& field, bool value) {
  return field.choices.empty() ? Json(value) : Json(field.choices[value ? 0 : 1]);
}
inline Json FieldJson(const Field&, Seconds value) {
  return value.count();
}
// Rounds to four digits, which are enough to draw the numbers.
inline Json FieldJson(const Field&, const std::vector<float>& value) {
  Json json = Json::array();
  for (const float number : value) json.push_back(Json::parse(Significant(number, 4)));
  return json;
}
template <typename Struct>
Json FieldJson(const Field&, const std::vector<Struct>& value) {
  Json json = Json::array();
  for (const Struct& each : value) json.push_back(FieldsJson(each));
  return json;
}
template <typename Value>
Json FieldJson(const Field&, const Value& value) {
  if constexpr (std::is_enum_v<Value>) {
    return ToString(value);
  } else if constexpr (std::is_class_v<Value> && !std::is_same_v<Value, std::string>) {
    return FieldsJson(value);
  } else {
    return value;
  }
}
template <typename Value>
Json FieldJson(const Field& field, const std::optional<Value>& value) {
  return value ? FieldJson(field, *value) : Json();
}

template <typename Struct>
Json FieldsJson(const Struct& value) {
  Json json = Json::object();
  EachField(value, [&](const Field& field, const auto& member) { json[field.name] = FieldJson(field, member); });
  return json;
}

}  // namespace planish::cli
