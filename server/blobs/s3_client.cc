#include "server/blobs/s3_client.h"

#include <curl/curl.h>
#include <expat.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <random>
#include <sstream>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/read_file.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

// Limit for responses other than objects.
constexpr std::size_t kMostAnswerBytes = std::size_t{16} << 20;
constexpr std::size_t kMostIdle = 16;
constexpr std::int64_t kBytesPerSecond = std::int64_t{1} << 20;

absl::Status S3Unavailable(const std::string& why) {
  return MakeError(absl::StatusCode::kUnavailable, "STORE_UNAVAILABLE", "the S3 server: " + why);
}

// ---- XML

// Finds the text of each element without children, in order, with its path, such as "Error/Code".
class XmlTexts {
 public:
  using Visit = std::function<void(const std::string& path, const std::string& text)>;

  // Calls `visit` for these elements. False if the document is malformed.
  static bool Read(std::string_view document, const Visit& visit) {
    XmlTexts texts(visit);
    const XML_Parser parser = XML_ParserCreate("UTF-8");
    if (parser == nullptr) return false;
    XML_SetUserData(parser, &texts);
    XML_SetElementHandler(parser, &XmlTexts::Start, &XmlTexts::End);
    XML_SetCharacterDataHandler(parser, &XmlTexts::Text);
    const bool ok =
        XML_Parse(parser, document.data(), static_cast<int>(document.size()), /*isFinal=*/1) == XML_STATUS_OK;
    XML_ParserFree(parser);
    return ok;
  }

 private:
  explicit XmlTexts(const Visit& visit) : visit_(visit) {}

  static void Start(void* self, const char* name, const char**) {
    auto& texts = *static_cast<XmlTexts*>(self);
    texts.lengths_.push_back(texts.path_.size());
    absl::StrAppend(&texts.path_, texts.path_.empty() ? "" : "/", name);
    texts.text_.clear();
  }
  static void End(void* self, const char*) {
    auto& texts = *static_cast<XmlTexts*>(self);
    texts.visit_(texts.path_, texts.text_);
    texts.path_.resize(texts.lengths_.back());
    texts.lengths_.pop_back();
    texts.text_.clear();
  }
  static void Text(void* self, const char* text, int size) {
    static_cast<XmlTexts*>(self)->text_.append(text, static_cast<std::size_t>(size));
  }

  const Visit& visit_;
  std::string path_, text_;
  std::vector<std::size_t> lengths_;  // for each open element: the length of path_ before it began
};

// The error of an S3 response: "CODE: MESSAGE".
struct S3Error {
  std::string code, message;
};

std::optional<S3Error> ErrorOf(std::string_view body) {
  S3Error error;
  const bool read = XmlTexts::Read(body, [&](const std::string& path, const std::string& text) {
    if (path == "Error/Code") error.code = text;
    if (path == "Error/Message") error.message = text;
  });
  if (!read || error.code.empty()) return std::nullopt;
  return error;
}

// ---- libcurl

std::string Escaped(std::string_view text) {
  const std::string copy(text);
  char* const escaped = curl_easy_escape(nullptr, copy.c_str(), static_cast<int>(copy.size()));
  std::string result = escaped == nullptr ? "" : escaped;
  curl_free(escaped);
  return result;
}

std::string EscapedPath(std::string_view path) {
  std::string result;
  for (;;) {
    const std::size_t slash = path.find('/');
    result += Escaped(path.substr(0, slash));
    if (slash == std::string_view::npos) return result;
    result += '/';
    path.remove_prefix(slash + 1);
  }
}

std::string Stripped(const std::string& text) {
  return std::string(absl::StripAsciiWhitespace(text));
}

class HeaderList {
 public:
  HeaderList() = default;
  HeaderList(const HeaderList&) = delete;
  HeaderList& operator=(const HeaderList&) = delete;
  ~HeaderList() { curl_slist_free_all(list_); }

  void Add(const std::string& line) { list_ = curl_slist_append(list_, line.c_str()); }
  curl_slist* get() const { return list_; }

 private:
  curl_slist* list_ = nullptr;
};

struct Sending {
  std::string_view bytes;
  std::size_t sent = 0;
};

struct Receiving {
  std::string* body;
  std::size_t most;
  std::string date;
};

std::size_t SendPiece(char* buffer, std::size_t size, std::size_t count, void* data) {
  auto& sending = *static_cast<Sending*>(data);
  const std::size_t length = std::min(size * count, sending.bytes.size() - sending.sent);
  std::copy_n(sending.bytes.data() + sending.sent, length, buffer);
  sending.sent += length;
  return length;
}

int Rewind(void* data, curl_off_t offset, int origin) {
  auto& sending = *static_cast<Sending*>(data);
  if (origin != SEEK_SET || offset < 0 || static_cast<std::size_t>(offset) > sending.bytes.size()) {
    return CURL_SEEKFUNC_FAIL;
  }
  sending.sent = static_cast<std::size_t>(offset);
  return CURL_SEEKFUNC_OK;
}

std::size_t ReceivePiece(char* bytes, std::size_t size, std::size_t count, void* data) {
  auto& receiving = *static_cast<Receiving*>(data);
  if (receiving.body->size() + size * count > receiving.most) return 0;  // ends the transfer with an error
  receiving.body->append(bytes, size * count);
  return size * count;
}

std::size_t ReceiveHeader(char* bytes, std::size_t size, std::size_t count, void* data) {
  const std::string line = absl::AsciiStrToLower(std::string(bytes, size * count));
  if (line.starts_with("date:")) static_cast<Receiving*>(data)->date = Stripped(line.substr(5));
  return size * count;
}

// Whether retrying is pointless.
bool IsFinal(CURLcode code) {
  return code == CURLE_PEER_FAILED_VERIFICATION || code == CURLE_SSL_CACERT_BADFILE || code == CURLE_URL_MALFORMAT ||
         code == CURLE_UNSUPPORTED_PROTOCOL || code == CURLE_NOT_BUILT_IN || code == CURLE_BAD_FUNCTION_ARGUMENT;
}

bool MayPass(long status, const std::string& code) {
  return status == 408 || status == 429 || status >= 500 || code == "RequestTimeout" || code == "SlowDown" ||
         code == "BadDigest" || code == "XAmzContentSHA256Mismatch";
}

absl::Duration Shortened(absl::Duration delay) {
  thread_local std::minstd_rand random(std::random_device{}());
  return delay * std::uniform_real_distribution<double>(0.5, 1.0)(random);
}

}  // namespace

struct S3Client::Request {
  const char* method = "GET";
  std::string url;
  std::string range;        // "0-9"; empty: all
  std::string copy_source;  // empty: none
  std::string_view body;
  std::string body_sha256 = Sha256("");
  std::int64_t object_bytes = -1;  // expected size of the response; -1 if it is not an object
  std::int64_t bytes_to_move = 0;  // determines the time limit
};

struct S3Client::Response {
  long status = 0;
  std::string body;
  std::string date;
};

absl::StatusOr<S3Credentials> ReadS3Credentials(const std::string& file) {
  S3Credentials credentials;
  if (file.empty()) {
    const auto variable = [](const char* name) {
      const char* const value = std::getenv(name);
      return std::string(value == nullptr ? "" : value);
    };
    credentials = {variable("AWS_ACCESS_KEY_ID"), variable("AWS_SECRET_ACCESS_KEY"), variable("AWS_SESSION_TOKEN")};
  } else {
    const absl::StatusOr<std::string> content = ReadTextFile("the credentials", file);
    if (!content.ok()) {
      return MakeError(absl::StatusCode::kFailedPrecondition, "S3_CREDENTIALS",
                       std::string(content.status().message()));
    }
    std::istringstream lines(*content);
    bool is_default = false;
    for (std::string line; std::getline(lines, line);) {
      const std::string text = Stripped(line);
      if (text.starts_with('[')) is_default = text == "[default]";
      const std::size_t equals = text.find('=');
      if (!is_default || equals == std::string::npos || text.starts_with('#')) continue;
      const std::string key = Stripped(text.substr(0, equals)), value = Stripped(text.substr(equals + 1));
      if (key == "aws_access_key_id") credentials.access_key_id = value;
      if (key == "aws_secret_access_key") credentials.secret_access_key = value;
      if (key == "aws_session_token") credentials.session_token = value;
    }
  }
  if (!credentials.access_key_id.empty() && !credentials.secret_access_key.empty()) return credentials;
  return MakeError(absl::StatusCode::kFailedPrecondition, "S3_CREDENTIALS",
                   file.empty() ? "AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY are not both set"
                                : file + " has no aws_access_key_id and aws_secret_access_key under [default]");
}

S3Client::S3Client(S3Options options) : options_(std::move(options)) {
  static const CURLcode global = curl_global_init(CURL_GLOBAL_DEFAULT);
  static_cast<void>(global);
}

S3Client::~S3Client() {
  for (void* const curl : idle_) curl_easy_cleanup(curl);
}

std::string S3Client::UrlOf(const std::string& key) const {
  const std::string path = options_.prefix.empty() ? key : absl::StrCat(options_.prefix, "/", key);
  return absl::StrCat(options_.endpoint, "/", options_.bucket, "/", EscapedPath(path));
}

absl::StatusOr<S3Client::Response> S3Client::SendOnce(const Request& request, bool* retry) {
  *retry = false;
  CURL* curl = nullptr;
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      curl = idle_.back();
      idle_.pop_back();
    }
  }
  if (curl == nullptr) curl = curl_easy_init();
  if (curl == nullptr) {
    return MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY", "libcurl has no memory");
  }
  Response response;
  Sending sending = {request.body};
  const bool is_read = request.object_bytes >= 0;
  Receiving receiving = {&response.body,
                         std::max(kMostAnswerBytes, static_cast<std::size_t>(is_read ? request.object_bytes : 0)), ""};
  HeaderList headers;
  headers.Add("x-amz-content-sha256: " + absl::BytesToHexString(request.body_sha256));
  if (!request.copy_source.empty()) headers.Add("x-amz-copy-source: " + request.copy_source);
  const S3Credentials& credentials = options_.credentials;
  if (!credentials.session_token.empty()) headers.Add("x-amz-security-token: " + credentials.session_token);
  const std::string signing = absl::StrCat("aws:amz:", options_.region, ":s3");
  const absl::Duration timeout = options_.timeout + absl::Seconds(request.bytes_to_move / kBytesPerSecond);

  curl_easy_setopt(curl, CURLOPT_URL, request.url.c_str());
  curl_easy_setopt(curl, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(curl, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(curl, CURLOPT_AWS_SIGV4, signing.c_str());
  curl_easy_setopt(curl, CURLOPT_USERNAME, credentials.access_key_id.c_str());
  curl_easy_setopt(curl, CURLOPT_PASSWORD, credentials.secret_access_key.c_str());
  curl_easy_setopt(curl, CURLOPT_HTTPHEADER, headers.get());
  curl_easy_setopt(curl, CURLOPT_CONNECTTIMEOUT_MS,
                   static_cast<long>(absl::ToInt64Milliseconds(options_.connect_timeout)));
  curl_easy_setopt(curl, CURLOPT_TIMEOUT_MS, static_cast<long>(absl::ToInt64Milliseconds(timeout)));
  curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, &ReceivePiece);
  curl_easy_setopt(curl, CURLOPT_WRITEDATA, &receiving);
  curl_easy_setopt(curl, CURLOPT_HEADERFUNCTION, &ReceiveHeader);
  curl_easy_setopt(curl, CURLOPT_HEADERDATA, &receiving);
  if (!options_.ca_file.empty()) curl_easy_setopt(curl, CURLOPT_CAINFO, options_.ca_file.c_str());
  if (!request.range.empty()) curl_easy_setopt(curl, CURLOPT_RANGE, request.range.c_str());
  if (std::string_view(request.method) == "PUT") {
    curl_easy_setopt(curl, CURLOPT_UPLOAD, 1L);
    curl_easy_setopt(curl, CURLOPT_INFILESIZE_LARGE, static_cast<curl_off_t>(request.body.size()));
    curl_easy_setopt(curl, CURLOPT_READFUNCTION, &SendPiece);
    curl_easy_setopt(curl, CURLOPT_READDATA, &sending);
    curl_easy_setopt(curl, CURLOPT_SEEKFUNCTION, &Rewind);
    curl_easy_setopt(curl, CURLOPT_SEEKDATA, &sending);
  } else {
    curl_easy_setopt(curl, CURLOPT_CUSTOMREQUEST, request.method);
  }

  const CURLcode code = curl_easy_perform(curl);
  curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &response.status);
  response.date = receiving.date;
  curl_easy_reset(curl);  // keeps the connection
  {
    const std::lock_guard lock(mutex_);
    if (idle_.size() < kMostIdle) idle_.push_back(std::exchange(curl, nullptr));
  }
  if (curl != nullptr) curl_easy_cleanup(curl);

  if (code != CURLE_OK) {
    const std::string what = absl::StrCat(request.method, " failed: ", curl_easy_strerror(code));
    *retry = !IsFinal(code);
    return S3Unavailable(what);
  }
  const bool is_good = response.status >= 200 && response.status < 300;
  if (is_good && is_read) {
    if (response.status == 206 && static_cast<std::int64_t>(response.body.size()) == request.object_bytes) {
      return response;
    }
    *retry = true;  // the response was cut off
    return S3Unavailable(absl::StrCat("GET of ", request.object_bytes, " bytes was answered with ", response.status,
                                      " and ", response.body.size(), " bytes"));
  }
  // A copy may fail after the response began with 200; then the body has the error.
  const std::optional<S3Error> error = response.body.empty() ? std::nullopt : ErrorOf(response.body);
  if (is_good && !error.has_value()) return response;
  const std::string said = error.has_value() ? absl::StrCat(error->code, ": ", error->message) : "";
  const std::string what = absl::StrCat(request.method, " was answered with ", response.status, " ", said);
  const std::string reason = error.has_value() ? error->code : "";
  // The next errors must be fixed by an operator. They count as unavailable, so that callers wait until that is done.
  if (reason == "NoSuchBucket") return S3Unavailable(absl::StrCat(what, " (--blobs)"));
  if (response.status == 401 || response.status == 403) {
    return S3Unavailable(absl::StrCat(what, " (--s3-credentials, or the rights that go with them)"));
  }
  if (response.status == 404) return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND", what);
  if (response.status == 416) return MakeError(absl::StatusCode::kDataLoss, "BLOB_DAMAGED", what);
  if (response.status == 507 || reason == "QuotaExceeded") {
    return MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL", "the S3 server: " + what);
  }
  *retry = MayPass(response.status, reason) || is_good;
  return *retry ? S3Unavailable(what) : InternalError("the S3 server: " + what);
}

absl::StatusOr<S3Client::Response> S3Client::Send(const Request& request) {
  absl::Duration delay = options_.first_delay;
  for (int attempt = 1;; ++attempt) {
    bool retry = false;
    absl::StatusOr<Response> response = SendOnce(request, &retry);
    if (response.ok() || !retry) return response;
    if (attempt >= options_.attempts) {
      return S3Unavailable(
          absl::StrCat("gave up after ", attempt, " attempts; the last: ", response.status().message()));
    }
    options_.sleep(Shortened(delay));
    delay = std::min(2 * delay, options_.most_delay);
  }
}

absl::Status S3Client::Put(const std::string& key, std::string_view bytes, const std::string& sha256) {
  Request request;
  request.method = "PUT";
  request.url = UrlOf(key);
  request.body = bytes;
  request.body_sha256 = sha256;
  request.bytes_to_move = static_cast<std::int64_t>(bytes.size());
  return Send(request).status();
}

absl::Status S3Client::Get(const std::string& key, std::int64_t offset, std::int64_t length, std::string* bytes) {
  Request request;
  request.url = UrlOf(key);
  request.range = absl::StrCat(offset, "-", offset + length - 1);
  request.object_bytes = request.bytes_to_move = length;
  PLANISH_ASSIGN_OR_RETURN(Response response, Send(request));
  *bytes = std::move(response.body);
  return absl::OkStatus();
}

absl::Status S3Client::Copy(const std::string& from, const std::string& to) {
  Request request;
  request.method = "PUT";
  request.url = UrlOf(to);
  request.copy_source = UrlOf(from).substr(options_.endpoint.size());
  return Send(request).status();
}

absl::Status S3Client::Delete(const std::string& key) {
  Request request;
  request.method = "DELETE";
  request.url = UrlOf(key);
  const absl::Status status = Send(request).status();
  return absl::IsNotFound(status) ? absl::OkStatus() : status;
}

absl::Status S3Client::List(const std::string& prefix, const std::function<void(const S3Object&)>& visit) {
  const std::string before = options_.prefix.empty() ? "" : options_.prefix + "/";
  std::string after;
  for (bool is_more = true; is_more;) {
    Request request;
    // Version 1 of ListObjects, which every server supports. Parameters are sorted, as the signature requires.
    request.url = absl::StrCat(options_.endpoint, "/", options_.bucket, "?",
                               after.empty() ? "" : "marker=" + Escaped(after) + "&", "max-keys=", options_.list_page,
                               "&prefix=", Escaped(before + prefix));
    PLANISH_ASSIGN_OR_RETURN(const Response response, Send(request));
    const std::time_t date = curl_getdate(response.date.c_str(), nullptr);
    if (date < 0) return InternalError("the S3 server does not say what time it is");
    bool is_list = false, is_good = true;
    is_more = false;
    S3Object object;
    const bool read = XmlTexts::Read(response.body, [&](const std::string& path, const std::string& text) {
      if (path == "ListBucketResult") is_list = true;
      if (path == "ListBucketResult/IsTruncated") is_more = text == "true";
      if (path == "ListBucketResult/Contents/Key") object.key = text;
      if (path == "ListBucketResult/Contents/Size") is_good &= absl::SimpleAtoi(text, &object.bytes);
      if (path == "ListBucketResult/Contents/LastModified") {
        absl::Time modified;
        is_good &= absl::ParseTime(absl::RFC3339_full, text, &modified, nullptr);
        object.age = std::max(absl::FromTimeT(date) - modified, absl::ZeroDuration());
      }
      if (path != "ListBucketResult/Contents") return;
      after = object.key;
      is_good &= object.key.starts_with(before);
      if (!is_good) return;
      object.key.erase(0, before.size());
      visit(std::exchange(object, S3Object()));
    });
    if (!read || !is_list || !is_good) return InternalError("the S3 server answered with a list that is malformed");
  }
  return absl::OkStatus();
}

}  // namespace planish
