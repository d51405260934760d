// The constants of FlattenTuning by name, so that a sweep can vary them one at a time.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "core/abf/tuning.h"

namespace planish::bench {

// What halving and doubling mean for a constant.
enum class Scale {
  kPlain,     // of the number itself
  kBelowOne,  // of its distance from 1, which stays below 1
  kAboveOne,  // of its excess over 1
};

struct TuningConstant {
  std::string name;  // "newton.forcing.max_error"
  std::variant<double*, std::int64_t*> number;
  Scale scale = Scale::kPlain;

  double Value() const;
  // Multiplies the number, or its distance from 1, by `factor`; counts are rounded down, but stay at least 1.
  void Multiply(double factor) const;
};

// All constants of `tuning`, which must outlive them.
std::vector<TuningConstant> ConstantsOf(FlattenTuning* tuning);

}  // namespace planish::bench
