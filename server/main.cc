// planishd.
#include "server/daemon.h"

int main(int argc, char** argv) {
  return planish::RunDaemon(argc, argv, nullptr);
}
