#include "tests/fuzz/mutations.h"

#include <algorithm>
#include <cstddef>

namespace planish::fuzz {
namespace {

constexpr std::size_t kMaxSize = 8192;

}  // namespace

std::string Mutated(const std::vector<std::string>& corpus, std::mt19937& random) {
  const auto below = [&](std::size_t n) { return n == 0 ? std::size_t{0} : random() % n; };
  std::string bytes = corpus[below(corpus.size())];
  const std::size_t changes = 1 + below(4);
  for (std::size_t i = 0; i < changes; ++i) {
    const std::size_t at = below(bytes.size());
    switch (below(8)) {
      case 0:
        if (!bytes.empty()) bytes[at] = static_cast<char>(random());
        break;
      case 1:
        if (!bytes.empty()) bytes[at] = static_cast<char>(bytes[at] ^ 1 << below(8));
        break;
      case 2:
        bytes.insert(at, 1 + below(8), static_cast<char>(random()));
        break;
      case 3:
        bytes.erase(at, 1 + below(16));
        break;
      case 4:
        bytes.resize(at);
        break;
      case 5:
        for (std::size_t k = at; k < std::min(at + 1 + below(8), bytes.size()); ++k) bytes[k] = '\xFF';
        break;
      case 6:
        bytes.insert(at, bytes.substr(below(bytes.size()), 1 + below(64)));
        break;
      default: {
        const std::string& other = corpus[below(corpus.size())];
        const std::size_t from = below(other.size());
        bytes.replace(at, below(32), other.substr(from, 1 + below(64)));
      }
    }
  }
  if (bytes.size() > kMaxSize) bytes.resize(kMaxSize);
  return bytes;
}

}  // namespace planish::fuzz
