// What is known about a field of planish.v1 (proto/planish/v1/about.proto). EachField(), which the build makes from the
// proto (made/fields.h), calls visit(Field, member) for each field of a message and the member of the struct that
// stands for it in planish/types.h.
#pragma once

#include <string>
#include <vector>

namespace planish {

struct Field {
  const char* name = "";  // in the proto
  // The rest is for options only, but for `choices`.
  const char* flag = "";                  // of `planish unwrap`, without dashes
  const char* help = "";                  // of the flag; empty where the command parses it in code of its own
  const char* value = "";                 // what the help calls its value
  const char* group = "";                 // of flags in the help
  const char* unset = "";                 // the default, in words
  const char* zero = "";                  // word of the flag that stands for 0
  double min = 0, max = 0;                // of a number; none if both are 0
  bool above_min = false;                 // min itself is refused
  bool keeps_result = false;              // the UV are the same bytes for every value
  std::vector<std::string> choices = {};  // of an enum: its values in lower case, from number 1 on
};

}  // namespace planish
