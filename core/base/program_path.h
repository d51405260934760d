// The path of the running program.
#pragma once

#include <string>

namespace planish {

// The path to execute to start this program once more. Usually "/proc/self/exe", which stays the same program when its
// file is replaced. For a program of the relocatable tarball, the absolute path of its launcher
// (deploy/packages/launcher.cc): the launcher executes a dynamic loader, so /proc/self/exe is that loader.
std::string SelfToExecute();

// The absolute path of this program, or of its launcher, with links resolved. Empty if the file is gone.
std::string SelfPath();

}  // namespace planish
