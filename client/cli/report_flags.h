// The flags of `planish report`.
#pragma once

namespace CLI {
class App;
}

namespace planish::cli {

struct Arguments;

// Defines the subcommand; it fills input, more_inputs, output, texcoord, texture_size, tiles, padding and job_report of
// `arguments`.
void DefineReport(CLI::App& app, Arguments& arguments);

}  // namespace planish::cli
