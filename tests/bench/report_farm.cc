// How many jobs a second one PostgreSQL takes, and how many machines that serves.
#include <algorithm>
#include <map>
#include <string>

#include "tests/bench/report.h"

namespace planish::bench {
namespace {

std::string Milliseconds(const nlohmann::json& seconds) {
  return ThreeDigits(1e3 * seconds.get<double>());
}

std::string Rounds(const Runs& runs, const std::string& standby) {
  std::string text =
      "Ratios are to bare SQL of the same round. saturated: workers end at once what they claim; steady: workers that "
      "can "
      "end half of what bare SQL does; light: a quarter. A claim is the verb alone, with those that gave up since "
      "their "
      "turn did not come in time; a free worker waits for its next job through claims and the rests between "
      "them.\n\n" +
      HeaderRow({"round", "machines x workers", "jobs waiting", "bare SQL, jobs/s", "store, jobs/s", "ratio",
                 "claim p50 ms", "claim p99 ms", "claims that gave up", "free worker waits, p50 ms", "finish p99 ms",
                 "another tenant starts, ms", "database MB"});
  double bare = 0;
  for (const auto& run : runs) {
    if (run["standby"] != standby) continue;
    if (run["bench"] == "bare") bare = run["jobs_per_second"];
    if (!run.contains("claim_p50_seconds")) continue;
    const double rate = run["jobs_per_second"];
    text +=
        Row({run["bench"], run["machines"].dump() + " x " + run["slots"].dump(),
             WithCommas(run["waiting"].get<std::int64_t>()), ThreeDigits(bare), ThreeDigits(rate),
             ThreeDigits(rate / bare), Milliseconds(run["claim_p50_seconds"]), Milliseconds(run["claim_p99_seconds"]),
             ThreeDigits(100 * run["claims_given_up"].get<double>() / run["claims"].get<double>()) + " %",
             Milliseconds(run["wait_p50_seconds"]), Milliseconds(run["finish_p99_seconds"]),
             Milliseconds(run["lone_start_max_seconds"]),
             WithCommas(run["database_bytes"].get<std::int64_t>() / 1'000'000)});
  }
  return text;
}

// What the sustained rate means for a farm.
std::string Arithmetic(const Runs& runs) {
  std::map<std::string, double> sustained;  // by standby; the least of all rounds
  for (const auto& run : runs) {
    if (run["bench"] != "steady") continue;
    const double rate = run["jobs_per_second"];
    const auto [at, is_new] = sustained.emplace(run["standby"], rate);
    if (!is_new) at->second = std::min(at->second, rate);
  }
  std::string text =
      "\n## 1,000 machines\n\nMachines of 16 workers, whose jobs take so many seconds each, give the store this many "
      "jobs a "
      "second; beside it what the steady rounds sustained.\n\n" +
      HeaderRow({"seconds a job", "jobs/s of 1,000 machines", "sustained here", "with a synchronous standby"});
  for (const double seconds : {3.0, 10.0, 30.0, 100.0}) {
    const auto verdict = [&](const char* standby) {
      const auto at = sustained.find(standby);
      return at == sustained.end() ? std::string("not measured") : ThreeDigits(at->second);
    };
    text += Row({ThreeDigits(seconds), ThreeDigits(16'000 / seconds), verdict("none"), verdict("synchronous")});
  }
  return text;
}

}  // namespace

std::string ReportFarm(const Runs& runs) {
  std::string text =
      "## What bare SQL does\n\n"
      "`BareJobs` of `tests/bench/bare_jobs.h` writes the rows that the store writes, into tables of the same "
      "definition, with the same indexes and fillfactor, with as many jobs waiting. It knows beforehand what to write, "
      "so "
      "it reads nothing and decides nothing: what is left is what the store has to find out. Its statements are "
      "prepared, hold up to 16 rows and travel together, as those of the store. 16 connections accept, 16 claim and "
      "finish, one deletes.\n\n" +
      HeaderRow({"verb", "jobs of a transaction", "waits for the disk", "rows"}) +
      Row({"accept", "1: its caller is told", "yes",
           "a job, a label, a piece of work, an event, the tenant's account"}) +
      Row({"claim", "16, those that have waited longest", "no",
           "updates of jobs and pieces of work, an event each, the tenants' accounts, the virtual time"}) +
      Row({"finish", "1: its callers are told", "yes",
           "update of the job with its report, an event, the work goes, the tenant's account"}) +
      Row({"delete", "100, those that ended first", "no", "jobs, labels and events go, the tenants' accounts"}) +
      "\nThe store does the same, and by one transaction what comes to one process at the same moment: a front has 16 "
      "callers here, a machine 16 workers. Each still gets its own answer, after the commit.\n\n"
      "## One PostgreSQL\n\n" +
      Rounds(runs, "none") + "\n## With a synchronous standby\n\n" + Rounds(runs, "synchronous");
  for (const auto& run : runs) {
    if (run["bench"] != "machines") continue;
    text += "\n## " + run["machines"].dump() + " machines against one\n\nWorkers that sleep " +
            ThreeDigits(run["worker_seconds"]) + " s a job: " + ThreeDigits(run["one"]) +
            " jobs a second on one machine, " + ThreeDigits(run["many"]) + " on all, a ratio of " +
            ThreeDigits(run["ratio"]) + ".\n";
  }
  return text + Arithmetic(runs);
}

}  // namespace planish::bench
