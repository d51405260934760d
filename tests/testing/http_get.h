#pragma once

#include <map>
#include <string>

namespace planish {

struct HttpReply {
  int status = 0;  // 0: there was none
  std::string body;
  std::map<std::string, std::string> headers;
};

// `server`: "http://HOST:PORT". (Apart, since cpp-httplib's header is slow to compile and defines macros that Eigen's
// cannot live with.)
HttpReply HttpGet(const std::string& server, const std::string& path);
HttpReply HttpHead(const std::string& server, const std::string& path);

}  // namespace planish
