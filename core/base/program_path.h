// Where the program that runs lies.
#pragma once

#include <string>

namespace planish {

// What can be executed to start this program once more: "/proc/self/exe", which stays the same program when its file is
// replaced. A program of the relocatable tarball was loaded by a dynamic loader that its launcher executed
// (deploy/packages/launcher.cc); /proc/self/exe is then that loader, and this is the absolute path of the launcher.
std::string SelfToExecute();

// The absolute path of this program, without links; of its launcher, if it has one. Empty if its file is gone.
std::string SelfPath();

}  // namespace planish
