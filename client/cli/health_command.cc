// `planish health`.
#include <iostream>
#include <string>

#include "client/cli/commands.h"
#include "planish/error.h"

// Last, and in no other file of the command: it brings macros of <resolv.h> (_res) that Eigen's headers have as names.
#include <httplib.h>

namespace planish::cli {
namespace {

constexpr int kHttpOk = 200;
constexpr int kSeconds = 3;

}  // namespace

int RunHealth(const Arguments& arguments) {
  const std::string& url = arguments.health_url;
  // "http://HOST:PORT/PATH"; ParseArguments() looked at it.
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
