// The S3 requests that blobs need, over libcurl: signed (AWS Signature Version 4), with timeouts and retries.
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

// Reads the profile `default` of `file`, in the format of the AWS command-line tool (`aws_access_key_id = ...`), or, if
// `file` is empty, the environment: AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_SESSION_TOKEN. FAILED_PRECONDITION
// with S3_CREDENTIALS if they are missing or the file cannot be read.
absl::StatusOr<S3Credentials> ReadS3Credentials(const std::string& file);

struct S3Options {
  std::string endpoint;  // https://HOST[:PORT], or http; objects are ENDPOINT/BUCKET/KEY (path-style)
  std::string region = "us-east-1";
  std::string bucket;  // exists
  std::string prefix;  // prepended to all keys, without a slash at either end; empty: none
  S3Credentials credentials;
  std::string ca_file;  // PEM, for the server's certificate; empty: the system's

  int list_page = 1000;  // objects in one response, 1 to 1000

  absl::Duration connect_timeout = absl::Seconds(5);
  absl::Duration timeout = absl::Seconds(30);  // of one request, plus a second for each MiB of an object

  // A request that fails for a temporary reason is repeated after `first_delay`, twice that, four times that and so on
  // up to `most_delay`, each shortened at random by up to a half; `attempts` times in total (>= 1).
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

// Thread-safe. Errors: NOT_FOUND with BLOB_NOT_FOUND (no such object), DATA_LOSS with BLOB_DAMAGED, RESOURCE_EXHAUSTED
// with STORAGE_FULL (a quota), UNAVAILABLE with STORE_UNAVAILABLE (all attempts failed, or an operator must act: wrong
// credentials, no such bucket, an untrusted certificate), INTERNAL (refused for another reason). The message has the
// server's reason.
class S3Client {
 public:
  explicit S3Client(S3Options options);
  ~S3Client();
  S3Client(const S3Client&) = delete;
  S3Client& operator=(const S3Client&) = delete;

  // Stores an object. `sha256` (32 bytes) must be the digest of `bytes`; the server checks it.
  absl::Status Put(const std::string& key, std::string_view bytes, const std::string& sha256);
  // Replaces *bytes by the `length` (> 0) bytes of the object from `offset` on. DATA_LOSS with BLOB_DAMAGED if the
  // object ends before `offset`.
  absl::Status Get(const std::string& key, std::int64_t offset, std::int64_t length, std::string* bytes);
  // Copies an object within the server.
  absl::Status Copy(const std::string& from, const std::string& to);
  // Deletes an object. OK if the object does not exist.
  absl::Status Delete(const std::string& key);
  // Calls `visit` with each object whose key begins with `prefix`, in the order of keys.
  absl::Status List(const std::string& prefix, const std::function<void(const S3Object&)>& visit);

 private:
  struct Request;
  struct Response;

  // Repeats the request until it succeeds, is refused, or has failed S3Options::attempts times.
  absl::StatusOr<Response> Send(const Request& request);
  // Sends the request once. *retry: whether the error may be temporary.
  absl::StatusOr<Response> SendOnce(const Request& request, bool* retry);
  std::string UrlOf(const std::string& key) const;

  const S3Options options_;
  std::mutex mutex_;
  // Idle connections (CURL*). Guarded by mutex_.
  std::vector<void*> idle_;
};

}  // namespace planish
