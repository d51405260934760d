// A test program that is a worker when it is started as one.
#include <optional>

#include "gtest/gtest.h"
#include "server/worker_main.h"

int main(int argc, char** argv) {
  if (const std::optional<int> code = planish::RunIfWorker(argc, argv)) return *code;
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
