// bin/NAME of the relocatable tarball: executes libexec/NAME with the dynamic loader and the libraries in lib. Finds
// both relative to its own path, so the tarball works in any directory. It is linked statically, so it runs on any
// Linux of the same architecture.
//
// The program gets the path of this file as its argv[0] (core/base/program_path.h).
#include <limits.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

int main(int count, char** values) {
  std::string self(PATH_MAX, '\0');
  const ssize_t size = readlink("/proc/self/exe", self.data(), self.size());
  self.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  const std::size_t name = self.rfind('/');
  const std::size_t directory = name == std::string::npos || name == 0 ? name : self.rfind('/', name - 1);
  if (directory == std::string::npos) {
    std::fputs("planish: cannot tell where this program lies, without /proc\n", stderr);
    return 127;
  }
  const std::string root = self.substr(0, directory);
  std::string loader = root + "/lib/loader";
  std::string libraries = root + "/lib";
  std::string program = root + "/libexec" + self.substr(name);

  // Libraries in LD_PRELOAD and LD_AUDIT may need another C library than the tarball's.
  unsetenv("LD_PRELOAD");
  unsetenv("LD_AUDIT");
  // --inhibit-cache: the libraries in the system's cache belong to another C library.
  std::vector<std::string> words = {loader, "--inhibit-cache", "--library-path", libraries, "--argv0", self, program};
  for (int i = 1; i < count; ++i) words.push_back(values[i]);
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  execv(loader.c_str(), arguments.data());
  std::fprintf(stderr, "planish: cannot execute %s: %s\n", loader.c_str(), std::strerror(errno));
  return 127;
}
