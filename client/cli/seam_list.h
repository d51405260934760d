// What --seams=LIST asks for.
#pragma once

#include <string>
#include <vector>

#include "planish/types.h"

namespace planish::cli {

// A policy, and where the given seams come from.
struct SeamList {
  Seams policy = Seams::kAuto;
  double hard_edge_degrees = 0;          // 0: none
  bool uv = false;                       // borders of the file's UV islands
  bool materials = false;                // edges between faces of different materials
  bool groups = false;                   // edges between faces of different objects or groups
  std::vector<std::string> edge_files;   // of two vertex numbers per line
  std::vector<std::string> uncut_files;  // edges at which no seam is added, listed likewise

  // Whether any of the given seams has to be found on this side, in the file.
  bool NeedsFile() const { return uv || materials || groups || !edge_files.empty(); }
};

// Angle of "hard" without one, degrees.
inline constexpr double kDefaultHardEdge = 66;

// Reads a comma-separated list of at most one policy (none, keep, needed, auto) and any number of sources (uv, hard,
// hard:DEG, edges:FILE, materials, groups), and of uncut:FILE. Sources without a policy mean needed. Returns what is
// wrong with `text`, empty if nothing.
std::string ParseSeamList(const std::string& text, SeamList* list);

}  // namespace planish::cli
