#include "client/cli/option_flags.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <optional>
#include <type_traits>

#include "client/cli/text.h"
#include "made/fields.h"

namespace planish::cli {
namespace {

// The help text of a flag with range and default: "Texels per side of a tile, 16 to 65536 [1024]".
std::string HelpOf(const Field& field) {
  std::string help = field.help;
  std::string max = Significant(field.max, 6);
  if (const std::size_t at = max.find("e+0"); at != std::string::npos) max.erase(at + 1, 2);  // 1e9
  if (field.max > 0) help += field.min > 1 ? ", " + Significant(field.min, 6) + " to " + max : ", up to " + max;
  return help + " [" + field.unset + "]";
}

// Adds the flag of a field whose value is one of `field.choices`. Parsing choice i calls set(i).
void AddChoice(CLI::App& app, const Field& field, const std::function<void(std::size_t)>& set) {
  std::vector<std::string> shown = field.choices;  // the default first
  std::stable_partition(shown.begin(), shown.end(), [&](const std::string& name) { return name == field.unset; });
  app.add_option_function<std::string>(
         "--" + std::string(field.flag),
         [names = field.choices, set](const std::string& name) {
           set(static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin()));
         },
         HelpOf(field))
      ->check(CLI::IsMember(shown).description(""))
      ->type_name(CLI::detail::join(shown, "|"));
}

template <typename Number>
void AddNumber(CLI::App& app, const Field& field, const std::function<void(Number)>& set) {
  CLI::Option* const option = app.add_option_function<Number>(
      "--" + std::string(field.flag), [set](const Number& number) { set(number); }, HelpOf(field));
  option->type_name(field.value + (*field.zero == 0 ? "" : std::string("|") + field.zero));
  const double min = field.above_min ? std::nextafter(field.min, field.max) : field.min;
  const CLI::Range range(static_cast<Number>(min), static_cast<Number>(field.max));
  option->transform(CLI::Validator(
      [range, zero = std::string(field.zero)](std::string& text) {
        double number = 0;
        // CLI11 accepts "nan" in every range.
        const bool is_nan = CLI::detail::lexical_cast(text, number) && std::isnan(number);
        if (zero.empty() || text != zero) return is_nan ? "Value " + text + " is not a number" : range(text);
        text = "0";
        return std::string();
      },
      ""));
}

template <typename Value>
void AddOption(CLI::App& app, const Field& field, Value& value) {
  if constexpr (std::is_same_v<Value, bool>) {
    AddChoice(app, field, [&value](std::size_t i) { value = i == 0; });
  } else if constexpr (std::is_enum_v<Value>) {
    AddChoice(app, field, [&value](std::size_t i) { value = static_cast<Value>(i); });
  } else if constexpr (std::is_same_v<Value, std::optional<int>>) {
    AddNumber<int>(app, field, [&value](int number) { value = number; });
  } else {
    AddNumber<Value>(app, field, [&value](Value number) { value = number; });
  }
}

}  // namespace

void AddOptionsOfGroup(CLI::App& app, UnwrapOptions& options, const std::string& group) {
  EachField(options, [&](const Field& field, auto& member) {
    if (*field.help != 0 && field.group == group) AddOption(app, field, member);
  });
}

void AddOptions(CLI::App& app, UnwrapOptions& options, const std::vector<std::string>& names) {
  EachField(options, [&](const Field& field, auto& member) {
    if (std::find(names.begin(), names.end(), field.name) != names.end()) AddOption(app, field, member);
  });
}

}  // namespace planish::cli
