// What a tenant that floods the queue costs another one, with real worker processes:
//
//   planish_tenant_delay [FLOOD] [SINGLES] [GRID] [WORKERS]
//
// One JSON object on stdout.
#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <optional>

#include "nlohmann/json.hpp"
#include "server/worker_main.h"
#include "tests/bench/report.h"
#include "tests/faults/tenant_flood.h"

int main(int argc, char** argv) {
  if (const std::optional<int> code = planish::RunIfWorker(argc, argv)) return *code;
  const auto number = [&](int at, int otherwise) { return argc > at ? std::atoi(argv[at]) : otherwise; };
  planish::TenantFloodOptions options;
  options.flood = number(1, 1000);
  options.singles = number(2, 50);
  options.grid = number(3, 70);
  options.workers = number(4, 2);
  const planish::TenantFloodReport report = planish::RunTenantFlood(options);
  const auto most = [](const auto& values) { return *std::max_element(values.begin(), values.end()); };
  nlohmann::json line = {{"bench", "tenant_delay"}, {"flood", options.flood}, {"workers", options.workers}};
  line["triangles"] = 2 * options.grid * options.grid;
  line["singles"] = options.singles;
  line["flood_run_seconds"] = {{"median", planish::bench::Median(report.flood_run_seconds)},
                               {"max", most(report.flood_run_seconds)}};
  line["single_wait_seconds"] = {{"median", planish::bench::Median(report.single_wait_seconds)},
                                 {"max", most(report.single_wait_seconds)}};
  line["flood_jobs_begun_while_one_waited"] = most(report.overtaken_by);
  std::cout << line << std::endl;
  return 0;
}
