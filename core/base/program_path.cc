#include "core/base/program_path.h"

#include <errno.h>
#include <sys/auxv.h>

#include <filesystem>
#include <system_error>

namespace planish {

std::string SelfToExecute() {
  // AT_BASE is the address of the loader that the kernel has mapped; 0 if the program itself is a loader.
  const bool launched = getauxval(AT_BASE) == 0 && program_invocation_name[0] == '/';
  return launched ? program_invocation_name : "/proc/self/exe";
}

std::string SelfPath() {
  std::error_code error;
  return std::filesystem::canonical(SelfToExecute(), error);
}

}  // namespace planish
