#include "client/cli/health_command.h"

#include <iostream>
#include <string>

#include "client/cli/exit_codes.h"
#include "client/cli/flags.h"
#include "planish/error.h"

// Included last, and in no other file of the command: it defines macros (_res of <resolv.h>) that are names in Eigen's
// headers.
#include <httplib.h>

namespace planish::cli {
namespace {

constexpr int kHttpOk = 200;
constexpr int kSeconds = 3;

}  // namespace

void AddFlags(CLI::App& app, HealthArguments& arguments) {
  app.footer(
      "For probes of a planishd with --metrics-listen; needs no credentials. The path /readyz asks whether the server "
      "is ready for jobs,\n/livez whether it is alive. Exit codes: 0 yes, 1 no, 3 no answer.");
  app.add_option("URL", arguments.url, "URL to ask [http://127.0.0.1:9741/readyz]")->type_name("");
}

std::string Check(HealthArguments& arguments) {
  const std::string& url = arguments.url;
  if (url.starts_with("http://") && url.find('/', 7) != std::string::npos) return "";
  return "health asks an URL such as http://127.0.0.1:9741/readyz, not " + url;
}

int Run(const HealthArguments& arguments, Interrupts& /*interrupts*/) {
  const std::string& url = arguments.url;  // "http://HOST:PORT/PATH", as Check() requires
  const std::size_t path = url.find('/', std::string("http://").size());
  httplib::Client client(url.substr(0, path));
  client.set_connection_timeout(kSeconds);
  client.set_read_timeout(kSeconds);
  const httplib::Result answer = client.Get(url.substr(path));
  if (!answer) {
    throw Error(ErrorCode::kUnavailable, "SERVER_UNREACHABLE", url + " does not answer: " + to_string(answer.error()));
  }
  std::string text = answer->body.empty() ? "HTTP " + std::to_string(answer->status) : answer->body;
  if (text.back() != '\n') text += '\n';
  (answer->status == kHttpOk ? std::cout : std::cerr) << text << std::flush;
  return answer->status == kHttpOk ? kOk : kFailed;
}

}  // namespace planish::cli
