// planishd-farm: planishd with what it takes to share a store with others.
#include "server/daemon.h"
#include "server/farm_stores.h"

int main(int argc, char** argv) {
  return planish::RunDaemon(argc, argv, planish::OpenFarmStores);
}
