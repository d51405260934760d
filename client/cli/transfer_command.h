// `planish transfer`, which needs no server: the images of one file in the map of another.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/cli/arguments.h"

namespace planish::cli {

class Interrupts;

struct TransferArguments {
  std::string from, to;
  std::string output;
  int texture_size = 0;                // 0: as many texels as keep the density
  int texcoord = 0;                    // of `to`
  std::optional<int> output_texcoord;  // of `from`
  bool project = false;                // between surfaces that only lie close
  std::string bake_list;
  std::vector<std::string> bake;   // of bake_list; empty: colours and normals with `project`
  double occlusion_percent = 100;  // how far FROM hides the sky, in hundredths of its diagonal
  double cage_percent = 1;         // how far apart, in hundredths of the diagonal of `to`
  TextureArguments textures;       // its limits
  bool json = false;
  TerminalArguments terminal;
};

void AddFlags(CLI::App& app, TransferArguments& arguments);
std::string Check(TransferArguments& arguments);
int Run(const TransferArguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
