// planish_bench_report BENCH RUNS.jsonl COLUMNS < heading > TABLE.md: the heading, then the tables. BENCH is one of
// those in Main(); COLUMNS is the start of the names of the files for gnuplot.
#include <cstdio>
#include <exception>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>

#include "tests/bench/report.h"

namespace planish::bench {
namespace {

int Main(int argc, char** argv) {
  const std::string which = argc == 4 ? argv[1] : "";
  if (which != "paper" && which != "scale" && which != "peers" && which != "atlas" && which != "memory" &&
      which != "service" && which != "tuning" && which != "farm") {
    std::fprintf(stderr,
                 "usage: planish_bench_report paper|scale|peers|atlas|memory|service|tuning|farm RUNS.jsonl COLUMNS < "
                 "heading > TABLE.md\n");
    return 2;
  }
  Runs runs;
  std::ifstream file(argv[2]);
  for (std::string line; std::getline(file, line);) {
    if (!line.empty()) runs.push_back(nlohmann::json::parse(line));
  }
  const std::string heading(std::istreambuf_iterator<char>(std::cin), {});
  const std::string tables = which == "paper"    ? ReportPaper(runs, argv[3])
                             : which == "scale"  ? ReportScale(runs, argv[3])
                             : which == "peers"  ? ReportPeers(runs, argv[3])
                             : which == "atlas"  ? ReportAtlas(runs, argv[3])
                             : which == "memory" ? ReportMemory(runs, argv[3])
                             : which == "tuning" ? ReportTuning(runs)
                             : which == "farm"   ? ReportFarm(runs)
                                                 : ReportService(runs, argv[3]);
  std::cout << heading << "\n" << tables;
  return 0;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  try {
    return planish::bench::Main(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "planish_bench_report: %s\n", error.what());
    return 1;
  }
}
