#include "tests/server/testing/http_get.h"

#include <httplib.h>

namespace planish {

HttpReply HttpGet(const std::string& server, const std::string& path) {
  const auto answer = httplib::Client(server).Get(path);
  return answer ? HttpReply{answer->status, answer->body} : HttpReply();
}

}  // namespace planish
