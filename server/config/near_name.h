#pragma once

#include <string>
#include <vector>

namespace planish {

// The name among `names` that was probably meant by `text`: the one that the fewest changes of a character (put in,
// left out, replaced) lead to, if these are few for its length. Empty if there is none. '_' counts as '-'.
std::string NearName(const std::string& text, const std::vector<std::string>& names);

}  // namespace planish
