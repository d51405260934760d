// AWS Signature Version 4 computed here from its specification, and compared with what the client sends: the S3 server
// of the tests does not look at it.
#include <algorithm>
#include <map>
#include <sstream>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "openssl/evp.h"
#include "openssl/hmac.h"
#include "server/blobs/s3_client.h"
#include "tests/server/blobs/faulty_proxy.h"

namespace planish {
namespace {

std::string Hmac(const std::string& key, const std::string& text) {
  unsigned char result[32];
  unsigned int size = 0;
  HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()), reinterpret_cast<const unsigned char*>(text.data()),
       text.size(), result, &size);
  return {reinterpret_cast<const char*>(result), size};
}

struct SignedRequest {
  std::string method, path, query;             // as on the request line
  std::map<std::string, std::string> headers;  // names in lower case
  std::string body;

  static SignedRequest Parse(const std::string& request) {
    SignedRequest parsed;
    const std::size_t end = request.find("\r\n\r\n");
    const std::vector<std::string> lines = absl::StrSplit(request.substr(0, end), "\r\n");
    const std::vector<std::string> first = absl::StrSplit(lines.at(0), ' ');
    const std::vector<std::string> target = absl::StrSplit(first.at(1), absl::MaxSplits('?', 1));
    parsed.method = first[0];
    parsed.path = target[0];
    if (target.size() > 1) parsed.query = target[1];
    for (std::size_t i = 1; i < lines.size(); ++i) {
      const std::vector<std::string> header = absl::StrSplit(lines[i], absl::MaxSplits(':', 1));
      parsed.headers[absl::AsciiStrToLower(header.at(0))] = std::string(absl::StripAsciiWhitespace(header.at(1)));
    }
    parsed.body = request.substr(end + 4);
    return parsed;
  }

  // "Credential", "SignedHeaders" or "Signature" of the header Authorization.
  std::string Authorization(const std::string& name) const {
    const std::string value = headers.at("authorization");
    const std::size_t begin = value.find(name + "=") + name.size() + 1;
    return value.substr(begin, value.find(',', begin) - begin);
  }

  std::string Signature(const std::string& secret) const {
    const std::vector<std::string> names = absl::StrSplit(Authorization("SignedHeaders"), ';');
    std::string canonical_headers;
    for (const std::string& name : names) canonical_headers += name + ":" + headers.at(name) + "\n";
    std::vector<std::string> parameters;
    for (std::string parameter : std::vector<std::string>(absl::StrSplit(query, '&', absl::SkipEmpty()))) {
      parameters.push_back(parameter.find('=') == std::string::npos ? parameter + "=" : parameter);
    }
    std::sort(parameters.begin(), parameters.end());
    const std::string canonical = method + "\n" + path + "\n" + absl::StrJoin(parameters, "&") + "\n" +
                                  canonical_headers + "\n" + absl::StrJoin(names, ";") + "\n" +
                                  headers.at("x-amz-content-sha256");
    const std::vector<std::string> scope = absl::StrSplit(Authorization("Credential"), '/');
    const std::string text = "AWS4-HMAC-SHA256\n" + headers.at("x-amz-date") + "\n" +
                             absl::StrJoin(scope.begin() + 1, scope.end(), "/") + "\n" +
                             absl::BytesToHexString(Sha256(canonical));
    std::string key = "AWS4" + secret;
    for (std::size_t i = 1; i < scope.size(); ++i) key = Hmac(key, scope[i]);
    return absl::BytesToHexString(Hmac(key, text));
  }
};

// The example of AWS's own documentation ("GET Object").
TEST(S3SignatureTest, OfThePublishedExample) {
  const SignedRequest request = SignedRequest::Parse(
      "GET /test.txt HTTP/1.1\r\n"
      "Host: examplebucket.s3.amazonaws.com\r\n"
      "Range: bytes=0-9\r\n"
      "x-amz-content-sha256: e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855\r\n"
      "x-amz-date: 20130524T000000Z\r\n"
      "Authorization: AWS4-HMAC-SHA256 Credential=AKIAIOSFODNN7EXAMPLE/20130524/us-east-1/s3/aws4_request,"
      "SignedHeaders=host;range;x-amz-content-sha256;x-amz-date,Signature=none\r\n\r\n");
  EXPECT_EQ(request.Signature("wJalrXUtnFEMI/K7MDENG/bPxRfiCYEXAMPLEKEY"),
            "f0e8bdb87c964420e857bd35b5d6ed310bd44f0170aba48dd91039c6036bdb41");
}

class SentSignatureTest : public ::testing::Test {
 protected:
  SentSignatureTest() {
    options_.endpoint = "http://127.0.0.1:" + std::to_string(proxy_.port());
    options_.region = "eu-central-1";
    options_.bucket = "a-bucket";
    options_.prefix = "with space/and+plus";
    options_.credentials = {"AKID", "secret/with+signs=", "session/token=="};
    options_.attempts = 1;
  }

  // What `call` sends is signed as it must be.
  SignedRequest Check(const std::function<absl::Status(S3Client& client)>& call) {
    proxy_.Next({HttpFault::kRefuse});
    S3Client client(options_);
    EXPECT_FALSE(call(client).ok()) << "nobody is behind the proxy";
    const SignedRequest request = SignedRequest::Parse(proxy_.last_request());
    EXPECT_THAT(request.Authorization("Credential"), ::testing::StartsWith("AKID/"));
    EXPECT_THAT(request.Authorization("Credential"), ::testing::EndsWith("/eu-central-1/s3/aws4_request"));
    EXPECT_EQ(request.Authorization("Signature"), request.Signature(options_.credentials.secret_access_key));
    EXPECT_EQ(request.headers.at("x-amz-content-sha256"), absl::BytesToHexString(Sha256(request.body)));
    const std::vector<std::string> names = absl::StrSplit(request.Authorization("SignedHeaders"), ';');
    for (const char* name : {"host", "x-amz-content-sha256", "x-amz-date", "x-amz-security-token"}) {
      EXPECT_THAT(names, ::testing::Contains(name));
    }
    EXPECT_TRUE(std::is_sorted(names.begin(), names.end()));
    return request;
  }

  FaultyProxy proxy_{1};
  S3Options options_;
};

TEST_F(SentSignatureTest, Put) {
  const std::string bytes(2'000'000, 'p');
  const SignedRequest request = Check([&](S3Client& client) { return client.Put("a/b", bytes, Sha256(bytes)); });
  EXPECT_EQ(request.method, "PUT");
  EXPECT_EQ(request.path, "/a-bucket/with%20space/and%2Bplus/a/b");
  EXPECT_TRUE(request.body == bytes);
}

TEST_F(SentSignatureTest, Get) {
  std::string bytes;
  const SignedRequest request = Check([&](S3Client& client) { return client.Get("a/b", 10, 20, &bytes); });
  EXPECT_EQ(request.method, "GET");
  EXPECT_EQ(request.headers.at("range"), "bytes=10-29");
}

TEST_F(SentSignatureTest, Copy) {
  const SignedRequest request = Check([&](S3Client& client) { return client.Copy("from", "to"); });
  EXPECT_EQ(request.path, "/a-bucket/with%20space/and%2Bplus/to");
  EXPECT_EQ(request.headers.at("x-amz-copy-source"), "/a-bucket/with%20space/and%2Bplus/from");
  EXPECT_THAT(request.Authorization("SignedHeaders"), ::testing::HasSubstr("x-amz-copy-source"));
}

TEST_F(SentSignatureTest, Delete) {
  EXPECT_EQ(Check([&](S3Client& client) { return client.Delete("a/b"); }).method, "DELETE");
}

TEST_F(SentSignatureTest, List) {
  const SignedRequest request = Check([&](S3Client& client) { return client.List("a/", [](const S3Object&) {}); });
  EXPECT_EQ(request.path, "/a-bucket");
  EXPECT_EQ(request.query, "max-keys=1000&prefix=with%20space%2Fand%2Bplus%2Fa%2F");
}

}  // namespace
}  // namespace planish
