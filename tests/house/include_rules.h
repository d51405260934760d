// Which folder may include what; .github/CONTRIBUTING.md draws the picture.
#pragma once

#include <string>
#include <vector>

#include "tests/house/source_tree.h"

namespace planish::house {

// One sentence per #include that breaks a rule, "path:line: ...", in the order of the files. `all` are the files that
// exist, so that an include can be told to lead nowhere.
std::vector<std::string> FindBrokenRules(const std::vector<SourceFile>& files, const std::vector<SourceFile>& all);

}  // namespace planish::house
