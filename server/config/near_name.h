#pragma once

#include <string>
#include <vector>

namespace planish {

// The name among `names` that `text` probably means: the one with the smallest edit distance, if that is small for its
// length. Empty if there is none. '_' counts as '-'.
std::string NearName(const std::string& text, const std::vector<std::string>& names);

}  // namespace planish
