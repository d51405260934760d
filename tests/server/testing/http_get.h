#pragma once

#include <string>

namespace planish {

struct HttpReply {
  int status = 0;  // 0: there was none
  std::string body;
};

// `server`: "http://HOST:PORT". (Apart, since cpp-httplib's header defines macros that Eigen's cannot live with.)
HttpReply HttpGet(const std::string& server, const std::string& path);

}  // namespace planish
