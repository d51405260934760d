// The flags of `planish check`.
#pragma once

#include <set>

namespace CLI {
class App;
}

namespace planish::cli {

struct Arguments;

enum class Requirement { kUv, kNoOverlap, kNoFlip, kNoMirror, kNoDegenerate, kInTile };
const char* ToString(Requirement requirement);  // "no-overlap", ...

struct CheckArguments {
  std::set<Requirement> required;
  double max_stretch = 0;      // L2 stretch of any chart, above 1; 0: any
  double min_padding = 0;      // texels between any two charts; 0: any
  bool all_texcoords = false;  // every set of UV that the file has; otherwise Arguments::texcoord
};

// Defines the subcommand; it fills input, more_inputs, json, texcoord, texture_size, tiles and `check` of `arguments`.
void DefineCheck(CLI::App& app, Arguments& arguments);

}  // namespace planish::cli
