// An S3 server of the test's own: a package of npm, a temporary folder, loopback.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "absl/time/time.h"
#include "server/blobs/s3_client.h"
#include "tests/testing/files.h"
#include "tests/testing/process.h"

namespace planish {

class S3Server {
 public:
  // Starts it. Throws std::runtime_error if that cannot be.
  S3Server();

  // Empty if it runs; otherwise why it cannot be had on this machine.
  const std::string& why_not() const { return why_not_; }
  int port() const { return port_; }

  // For its bucket, without a prefix. No attempt is made twice.
  S3Options Options() const;

  // The file with the bytes of an object. Whoever changes it changes the object.
  std::filesystem::path FileOf(const std::string& key) const;

 private:
  const TempDir directory_;
  std::unique_ptr<Process> process_;
  std::string why_not_;
  int port_ = 0;
};

}  // namespace planish
