// What a command says at its end, for people.
#pragma once

#include <string>

#include "client/cli/text.h"
#include "planish/client.h"

namespace planish::cli {

// Two to four lines about result and quality, for any number of charts; the first few warnings of each kind; and, if
// the result is not usable, why. `output` is the file that was written; empty if none. `verbose`: also the seconds of
// each stage, memory, the largest charts, and every warning.
std::string Summary(const Report& report, const std::string& output, const Terminal& terminal, bool verbose = false);

// Why the result is not usable; empty if it is.
std::string WhyNotUsable(const Report& report);

// "planish: error: ..." with the `places` in the file, if any, and what can be done about it, as far as we know.
std::string ErrorText(const Error& error, const std::string& places, const Terminal& terminal);

}  // namespace planish::cli
