#include "tests/server/blobs/s3_server.h"

#include <cstdio>
#include <stdexcept>

namespace planish {
namespace {

// The S3 server refuses all others.
constexpr char kKey[] = "S3RVER", kSecret[] = "S3RVER";

constexpr int kSkipped = 77;

}  // namespace

S3Server::S3Server() {
  process_ = std::make_unique<Process>(std::vector<std::string>{
      "/bin/sh", std::string(PLANISH_SOURCE_TREE) + "/tests/s3/run.sh", PLANISH_S3_WORK, directory_.Path()});
  // The packages may have to be fetched first.
  if (process_->WaitForErr("port ", 120)) {
    const std::string said = process_->Err();
    if (std::sscanf(said.c_str() + said.find("port "), "port %d", &port_) != 1) {
      throw std::runtime_error("no S3 server: " + said);
    }
    return;
  }
  const Outcome outcome = process_->Wait();
  if (outcome.exit_code != kSkipped) throw std::runtime_error("no S3 server: " + outcome.out + outcome.err);
  why_not_ = outcome.out;
}

S3Options S3Server::Options() const {
  S3Options options;
  options.endpoint = "http://127.0.0.1:" + std::to_string(port_);
  options.bucket = "blobs";
  options.credentials = {kKey, kSecret, ""};
  options.attempts = 1;
  return options;
}

std::filesystem::path S3Server::FileOf(const std::string& key) const {
  return directory_.Path("blobs/" + key + "._S3rver_object");
}

}  // namespace planish
