// What `planish unwrap a.obj b.glb dir/ -o out/` is about to do: decided in full before anything runs.
//
// Every file that was named, and every mesh file in a directory that was named, becomes one job and one output. The
// output of a named file lies in the output directory itself, that of a file found in a directory at the same place
// below the output directory as the file below the directory that was named.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/arguments.h"
#include "planish/error.h"

namespace planish::cli {

struct BatchItem {
  std::string name;    // place below the directory that was named, or the file's own name: no two are alike
  std::string input;   // path to read
  std::string key;     // place below the output directory: no two are alike
  std::string output;  // path to write
  std::int64_t bytes = 0;
  int texcoord = 0;              // Arguments::texcoord for a glTF, 0 for others
  std::optional<Error> problem;  // why it cannot be done, known already: no mesh file, a directory beyond reading
};

struct BatchPlan {
  std::vector<BatchItem> items;  // in the order of the arguments; those of a directory sorted by their paths
  // What was found in directories and left out, by kind: ".mtl", "no extension", "hidden", "link to a directory",
  // "output directory".
  std::map<std::string, int> skipped;
};

// Looks at the inputs of `arguments`, a batch. Throws planish::Error: BATCH_OUTPUT_CONFLICT where two files would
// become one, or an output is an input; BATCH_OUTPUT_UNSUPPORTED where the output is no directory; BATCH_EMPTY where
// there is nothing to do.
BatchPlan PlanBatch(const Arguments& arguments);

// "Skipped in directories: 12 .mtl, 3 .png, 1 hidden.\n"; empty if nothing was.
std::string SkippedText(const BatchPlan& plan);

}  // namespace planish::cli
