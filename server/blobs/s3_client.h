// The few calls of S3 that blobs need, over libcurl: signed (AWS Signature Version 4), with timeouts and retries.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace planish {

struct S3Credentials {
  std::string access_key_id;
  std::string secret_access_key;
  std::string session_token;  // empty: none
};

// From the profile `default` of `file`, which is written as the AWS command-line tool does (`aws_access_key_id = ...`);
// with an empty `file` from the environment: AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_SESSION_TOKEN.
// FAILED_PRECONDITION with S3_CREDENTIALS if they are not there, or the file cannot be read.
absl::StatusOr<S3Credentials> ReadS3Credentials(const std::string& file);

struct S3Options {
  std::string endpoint;  // https://HOST[:PORT], or http; objects are ENDPOINT/BUCKET/KEY (path-style)
  std::string region = "us-east-1";
  std::string bucket;  // exists
  std::string prefix;  // of all keys, without a slash at either end; empty: none
  S3Credentials credentials;
  std::string ca_file;  // PEM, for the server's certificate; empty: those of the system

  int list_page = 1000;  // objects in one answer, 1 to 1000

  absl::Duration connect_timeout = absl::Seconds(5);
  absl::Duration timeout = absl::Seconds(30);  // of one request, and a second more for each MiB of an object

  // A request that failed for a reason that may pass is made again after `first_delay`, twice that, four times that and
  // so on up to `most_delay`, each shortened at random by up to a half; `attempts` times in all (>= 1).
  int attempts = 5;
  absl::Duration first_delay = absl::Milliseconds(200);
  absl::Duration most_delay = absl::Seconds(5);
  std::function<void(absl::Duration)> sleep = absl::SleepFor;
};

struct S3Object {
  std::string key;  // without S3Options::prefix
  std::int64_t bytes = 0;
  absl::Duration age;  // since it was written, by the server's clock
};

// Thread-safe. Errors: NOT_FOUND with BLOB_NOT_FOUND (no such object), RESOURCE_EXHAUSTED with STORAGE_FULL (a quota),
// UNAVAILABLE with STORE_UNAVAILABLE (all attempts failed), INTERNAL (refused: wrong credentials, no such bucket, a
// certificate that is not trusted; the message has what the server said).
class S3Client {
 public:
  explicit S3Client(S3Options options);
  ~S3Client();
  S3Client(const S3Client&) = delete;
  S3Client& operator=(const S3Client&) = delete;

  // `sha256` (32 bytes) is that of `bytes`; the server checks it.
  absl::Status Put(const std::string& key, std::string_view bytes, const std::string& sha256);
  // Replaces *bytes by `length` > 0 of them. DATA_LOSS with BLOB_DAMAGED if the object is shorter than `offset`.
  absl::Status Get(const std::string& key, std::int64_t offset, std::int64_t length, std::string* bytes);
  // Copies an object within the server.
  absl::Status Copy(const std::string& from, const std::string& to);
  // OK too if there is no such object.
  absl::Status Delete(const std::string& key);
  // Calls `visit` with each object whose key begins with `prefix`, in the order of keys.
  absl::Status List(const std::string& prefix, const std::function<void(const S3Object&)>& visit);

 private:
  struct Request;
  struct Response;

  // Until it succeeds, is refused, or has failed S3Options::attempts times.
  absl::StatusOr<Response> Send(const Request& request);
  // Once. `retry`: whether the error may pass.
  absl::StatusOr<Response> SendOnce(const Request& request, bool* retry);
  std::string UrlOf(const std::string& key) const;

  const S3Options options_;
  std::mutex mutex_;
  // Connections that nobody uses (CURL*). Guarded by mutex_.
  std::vector<void*> idle_;
};

}  // namespace planish
