// planishd-farm: planishd with the libraries for a store that several servers share.
#include "server/daemon.h"
#include "server/farm_stores.h"

int main(int argc, char** argv) {
  return planish::RunDaemon(argc, argv, planish::OpenFarmStores);
}
