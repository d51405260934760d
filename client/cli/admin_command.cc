#include "client/cli/admin_command.h"

#include <chrono>
#include <iostream>
#include <string>
#include <thread>

#include "client/cli/exit_codes.h"
#include "client/cli/flags.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "planish/admin.h"

namespace planish::cli {

void AddFlags(CLI::App& app, AdminArguments& arguments) {
  AddServer(app, arguments.server, "required here");
}

void AddFlags(CLI::App& app, AdminDrainArguments& arguments) {
  AddServer(app, arguments.server, "required here");
  app.add_flag("--wait", arguments.wait, "Wait until no job is left");
}

void AddFlags(CLI::App& app, AdminStatsArguments& arguments) {
  AddServer(app, arguments.server, "required here");
  AddJson(app, arguments.json);
}

std::string Check(AdminArguments& arguments) {
  return arguments.server.address.empty() ? "admin is about a server: give --server=ADDR or set PLANISH_SERVER" : "";
}

namespace {

constexpr std::chrono::milliseconds kLookInterval(250);

std::string Jobs(const ServerStats& stats) {
  return Counted(stats.running, "job runs", "jobs run") + ", " + Counted(stats.queued, "waits", "wait");
}

double Uptime(const ServerStats& stats) {
  return std::chrono::duration<double>(std::chrono::system_clock::now() - stats.start_time).count();
}

Json StatsJson(const ServerStats& stats) {
  Json tenants = Json::array();
  for (const ServerStats::Tenant& tenant : stats.tenants) {
    tenants.push_back({{"tenant", tenant.name},
                       {"queued", tenant.queued},
                       {"running", tenant.running},
                       {"accepted", tenant.accepted},
                       {"refused", tenant.refused}});
  }
  return {{"version", stats.version},
          {"uptime_seconds", Uptime(stats)},
          {"draining", stats.draining},
          {"workers", stats.workers},
          {"workers_ready", stats.workers_ready},
          {"queued", stats.queued},
          {"running", stats.running},
          {"reserved_memory_bytes", stats.reserved_memory_bytes},
          {"memory_bytes", stats.memory_bytes},
          {"stored_bytes", stats.stored_bytes},
          {"store_bytes", stats.store_bytes},
          {"oldest_wait_seconds", stats.oldest_wait.count()},
          {"tenants", tenants}};
}

void Print(const ServerStats& stats) {
  std::cout << "planishd " << stats.version << ", up for " << Duration(Uptime(stats))
            << (stats.draining ? ", draining: takes no new jobs" : "") << "\n"
            << "jobs     " << Jobs(stats);
  if (stats.queued > 0) std::cout << ", the oldest for " << Duration(stats.oldest_wait.count());
  std::cout << "\n"
            << "workers  " << stats.workers_ready << " of " << stats.workers << " ready\n"
            << "memory   " << Megabytes(stats.reserved_memory_bytes) << " of " << Megabytes(stats.memory_bytes)
            << " reserved\n"
            << "store    " << Megabytes(stats.stored_bytes) << " of " << Megabytes(stats.store_bytes) << "\n";
  for (const ServerStats::Tenant& tenant : stats.tenants) {
    std::cout << "tenant   " << Printable(tenant.name, true) << ": " << tenant.running << " running, " << tenant.queued
              << " queued, " << tenant.accepted << " accepted and " << tenant.refused << " refused so far\n";
  }
  std::cout << std::flush;
}

// Waits until no job waits or runs. Prints the numbers to stderr each time they change.
void WaitUntilIdle(AdminClient& admin) {
  std::string said;
  for (ServerStats stats = admin.GetStats(); !stats.IsIdle(); stats = admin.GetStats()) {
    const std::string jobs = Jobs(stats);
    if (jobs != said) std::cerr << "Draining: " << jobs << ".\n";
    said = jobs;
    std::this_thread::sleep_for(kLookInterval);
  }
}

AdminClient Connect(const AdminArguments& arguments) {
  return AdminClient(arguments.server.address, WithServer({}, arguments.server));
}

}  // namespace

int Run(const AdminDrainArguments& arguments, Interrupts& interrupts) {
  AdminClient admin = Connect(arguments);
  admin.Drain();
  if (!arguments.wait) {
    std::cerr << "The server takes no new jobs.\n";
    return kOk;
  }
  interrupts.SetLastWords([] { std::cerr << "The server goes on draining; planish admin undrain takes that back.\n"; });
  WaitUntilIdle(admin);
  interrupts.SetLastWords({});
  std::cerr << "Drained: no job is left.\n";
  return kOk;
}

int Run(const AdminUndrainArguments& arguments, Interrupts& /*interrupts*/) {
  Connect(arguments).Undrain();
  std::cerr << "The server takes new jobs again.\n";
  return kOk;
}

int Run(const AdminStatsArguments& arguments, Interrupts& /*interrupts*/) {
  const ServerStats stats = Connect(arguments).GetStats();
  if (arguments.json) {
    std::cout << ToText(StatsJson(stats)) << std::flush;
  } else {
    Print(stats);
  }
  return kOk;
}

int Run(const AdminConfigArguments& arguments, Interrupts& /*interrupts*/) {
  std::cout << Connect(arguments).GetConfig().yaml << std::flush;
  return kOk;
}

}  // namespace planish::cli
