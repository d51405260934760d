// Describes a field of planish.v1 (proto/planish/v1/about.proto). EachField(), which the build makes from the proto
// (made/fields.h), calls visit(Field, member) for each field of a message, with the member of planish/types.h that
// stands for the field.
#pragma once

#include <string>
#include <vector>

namespace planish {

struct Field {
  const char* name = "";  // in the proto
  // The members below, except for `choices`, are for options only.
  const char* flag = "";                  // of `planish unwrap`, without dashes
  const char* help = "";                  // text about the flag; empty if the command parses it in code of its own
  const char* value = "";                 // what the help calls the flag's value, e.g. "N"
  const char* group = "";                 // the group of flags in the help
  const char* unset = "";                 // the default, in words
  const char* zero = "";                  // the word, as value of the flag, that stands for 0
  double min = 0, max = 0;                // of a number; none if both are 0
  bool above_min = false;                 // min itself is refused
  bool keeps_result = false;              // the UV are the same bytes for every value
  std::vector<std::string> choices = {};  // of an enum: its values in lower case, from number 1 on
};

}  // namespace planish
