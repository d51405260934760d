#include "tests/testing/http_get.h"

#include <httplib.h>

namespace planish {
namespace {

HttpReply ToReply(const httplib::Result& answer) {
  if (!answer) return {};
  return {answer->status, answer->body, {answer->headers.begin(), answer->headers.end()}};
}

}  // namespace

HttpReply HttpGet(const std::string& server, const std::string& path) {
  return ToReply(httplib::Client(server).Get(path));
}

HttpReply HttpHead(const std::string& server, const std::string& path) {
  return ToReply(httplib::Client(server).Head(path));
}

}  // namespace planish
