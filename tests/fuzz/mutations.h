#pragma once

#include <random>
#include <string>
#include <vector>

namespace planish::fuzz {

// One of `corpus` (not empty), damaged in one to four places; some of the damage comes from another one of them. The
// same for the same `random`, on every machine.
std::string Mutated(const std::vector<std::string>& corpus, std::mt19937& random);

}  // namespace planish::fuzz
