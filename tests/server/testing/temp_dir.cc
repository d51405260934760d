#include "tests/server/testing/temp_dir.h"

#include <cstdlib>
#include <stdexcept>

namespace planish {

TempDir::TempDir() {
  std::string pattern = (std::filesystem::temp_directory_path() / "planish-test-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("cannot make " + pattern);
  path_ = pattern;
}

TempDir::~TempDir() {
  std::filesystem::remove_all(path_);
}

}  // namespace planish
