// Blobs in S3 while the network and the server misbehave, and what is signed.
#include <cstdlib>
#include <fstream>

#include "absl/strings/escaping.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/blobs/s3_blobs.h"
#include "tests/server/blobs/faulty_proxy.h"
#include "tests/server/blobs/s3_server.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

class S3Faults : public ::testing::Test {
 protected:
  static S3Server& Server() {
    static S3Server server;
    return server;
  }

  void SetUp() override {
    static int prefixes = 0;
    if (!Server().why_not().empty()) GTEST_SKIP() << Server().why_not();
    proxy_ = std::make_unique<FaultyProxy>(Server().port());
    options_.s3 = Server().Options();
    options_.s3.prefix = "faults " + std::to_string(++prefixes);
    options_.s3.endpoint = "http://127.0.0.1:" + std::to_string(proxy_->port());
    options_.s3.attempts = 4;
    options_.s3.timeout = absl::Seconds(20);
    options_.s3.sleep = [this](absl::Duration delay) { delays_.push_back(delay); };
    store_ = S3BlobStore::Make(options_).value();
  }

  std::unique_ptr<S3BlobStore> Another() { return S3BlobStore::Make(options_).value(); }

  static BlobId Id(const std::string& bytes) { return {"ann", Sha256(bytes)}; }
  static std::string Reason(const absl::Status& status) { return status.ok() ? "OK" : ErrorInfoOf(status).reason; }

  std::unique_ptr<FaultyProxy> proxy_;
  S3BlobsOptions options_;
  std::vector<absl::Duration> delays_;
  std::unique_ptr<S3BlobStore> store_;
};

// Every call, each of its requests failing twice in every way that may pass. (An answer without a body that is cut off
// after its status has said what there is to say.)
TEST_F(S3Faults, WhatMayPassIsTriedAgain) {
  const std::string bytes(300'000, 'b');
  const auto twice = [&](HttpFault fault, int untouched) {
    std::vector<HttpFault> faults(static_cast<std::size_t>(untouched), HttpFault::kNone);
    faults.insert(faults.end(), 2, fault);
    proxy_->Next(faults);
    delays_.clear();
  };
  for (const HttpFault fault : {HttpFault::kRefuse, HttpFault::kCutAnswer, HttpFault::kLoseAnswer}) {
    SCOPED_TRACE(static_cast<int>(fault));
    for (const int request : {0, 1}) {  // the list, the object
      const std::size_t without_body = fault == HttpFault::kCutAnswer && request == 1 ? 0 : 2;
      twice(fault, request);
      ASSERT_EQ(store_->Put(Id(bytes), bytes), absl::OkStatus());
      EXPECT_EQ(delays_.size(), without_body);
      proxy_->Next({});
      const auto reader = Another();
      twice(fault, request);
      EXPECT_TRUE((*reader->Load(Id(bytes)))->bytes() == bytes);
      EXPECT_EQ(delays_.size(), 2u);
      twice(fault, request);
      EXPECT_EQ(store_->Remove(Id(bytes), absl::ZeroDuration()).value(), true);
      EXPECT_EQ(delays_.size(), without_body);
      proxy_->Next({});
      EXPECT_EQ(Another()->Has(Id(bytes)).value(), false);
    }
  }
}

TEST_F(S3Faults, ACopyIsTriedAgain) {
  options_.renew_age = -absl::Seconds(1);
  store_ = Another();
  ASSERT_TRUE(store_->Put(Id("x"), "x").ok());
  proxy_->Next({HttpFault::kNone, HttpFault::kRefuse, HttpFault::kLoseAnswer});
  EXPECT_EQ(store_->Renew(Id("x")).value(), true);
  EXPECT_EQ(delays_.size(), 2u);
}

TEST_F(S3Faults, DelaysGrowUntilItGivesUp) {
  options_.s3.attempts = 6;
  options_.s3.first_delay = absl::Seconds(1);
  options_.s3.most_delay = absl::Seconds(5);
  store_ = Another();
  proxy_->Next(std::vector<HttpFault>(20, HttpFault::kRefuse));
  const int before = proxy_->requests();
  const absl::Status status = store_->Has(Id("x")).status();
  EXPECT_EQ(Reason(status), "STORE_UNAVAILABLE");
  EXPECT_THAT(std::string(status.message()), HasSubstr("503"));
  EXPECT_EQ(proxy_->requests() - before, 6);
  const double expected[] = {1, 2, 4, 5, 5};
  ASSERT_EQ(delays_.size(), std::size(expected));
  for (std::size_t i = 0; i < delays_.size(); ++i) {
    EXPECT_GE(absl::ToDoubleSeconds(delays_[i]), expected[i] / 2);
    EXPECT_LE(absl::ToDoubleSeconds(delays_[i]), expected[i]);
  }
}

TEST_F(S3Faults, SilenceEndsInTime) {
  options_.s3.timeout = absl::Milliseconds(200);
  options_.s3.attempts = 2;
  ASSERT_TRUE(store_->Put(Id("x"), "x").ok());
  proxy_->Next({HttpFault::kSilence, HttpFault::kSilence});
  const absl::Status status = S3BlobStore::Make(options_).status();
  EXPECT_EQ(Reason(status), "STORE_UNAVAILABLE");
  EXPECT_THAT(std::string(status.message()), HasSubstr("2 attempts"));
}

TEST_F(S3Faults, NobodyListens) {
  options_.s3.endpoint = "http://127.0.0.1:1";
  EXPECT_EQ(Reason(S3BlobStore::Make(options_).status()), "STORE_UNAVAILABLE");
  EXPECT_EQ(delays_.size(), 3u);
}

// Bytes that changed on their way are read again; good ones are not dropped for that.
TEST_F(S3Faults, WrongBytesOnTheWayAreFound) {
  const std::string bytes(10'000, 'w');
  ASSERT_TRUE(store_->Put(Id(bytes), bytes).ok());
  auto reader = Another();
  proxy_->Next({HttpFault::kNone, HttpFault::kWrongAnswer});
  EXPECT_TRUE((*reader->Load(Id(bytes)))->bytes() == bytes);
  reader = Another();
  proxy_->Next({HttpFault::kNone, HttpFault::kWrongAnswer, HttpFault::kWrongAnswer});
  EXPECT_EQ(Reason(reader->Open(Id(bytes)).status()), "BLOB_DAMAGED");
  EXPECT_EQ(Reason(reader->Open(Id(bytes)).status()), "BLOB_NOT_FOUND");
}

// Whether the server notices or not, nobody ever reads the wrong bytes.
TEST_F(S3Faults, WrongBytesOnTheWayThereAreFound) {
  const std::string bytes(10'000, 'u');
  proxy_->Next({HttpFault::kNone, HttpFault::kWrongUpload});
  ASSERT_TRUE(store_->Put(Id(bytes), bytes).ok());
  const auto reader = Another();
  const absl::StatusOr<BlobPtr> first = reader->Load(Id(bytes));
  if (first.ok()) {
    EXPECT_TRUE((*first)->bytes() == bytes);
    return;
  }
  EXPECT_EQ(Reason(first.status()), "BLOB_DAMAGED");
  ASSERT_TRUE(reader->Put(Id(bytes), bytes).ok());
  EXPECT_TRUE((*Another()->Load(Id(bytes)))->bytes() == bytes);
}

// The object is there once more, since the answer to the first attempt was lost; it counts once.
TEST_F(S3Faults, ALostAnswerLeavesOneBlob) {
  proxy_->Next({HttpFault::kNone, HttpFault::kLoseAnswer});
  ASSERT_TRUE(store_->Put(Id("x"), "x").ok());
  int listed = 0;
  EXPECT_TRUE(store_->List([&](const BlobEntry&) { ++listed; }).ok());
  EXPECT_EQ(listed, 1);
}

TEST_F(S3Faults, RefusalsAreNotTriedAgain) {
  const auto refused = [this](const S3BlobsOptions& options) {
    const int before = proxy_->requests();
    const absl::Status status = S3BlobStore::Make(options).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable) << status;
    EXPECT_EQ(Reason(status), "STORE_UNAVAILABLE");
    EXPECT_EQ(proxy_->requests() - before, 1);
    return std::string(status.message());
  };
  S3BlobsOptions wrong = options_;
  wrong.s3.credentials.access_key_id = "nobody";
  EXPECT_THAT(refused(wrong), HasSubstr("InvalidAccessKeyId: "));
  wrong = options_;
  wrong.s3.bucket = "nowhere";
  EXPECT_THAT(refused(wrong), HasSubstr("NoSuchBucket"));
}

TEST_F(S3Faults, ListsOfSeveralPages) {
  options_.s3.list_page = 3;
  S3Client client(options_.s3);
  std::vector<std::string> expected, keys;
  for (int i = 10; i < 22; ++i) {
    expected.push_back("many/" + std::to_string(i));
    ASSERT_EQ(client.Put(expected.back(), "x", Sha256("x")), absl::OkStatus());
  }
  ASSERT_EQ(client.Put("more", "x", Sha256("x")), absl::OkStatus());
  const int before = proxy_->requests();
  ASSERT_EQ(client.List("many/", [&](const S3Object& object) { keys.push_back(object.key); }), absl::OkStatus());
  EXPECT_EQ(keys, expected);
  EXPECT_GE(proxy_->requests() - before, 4);
}

TEST(S3CredentialsTest, FromAFile) {
  const TempDir directory;
  const std::string path = directory.Path("credentials");
  PutFile(path,
          "[other]\naws_access_key_id = wrong\naws_secret_access_key = wrong\n"
          "# a comment\n[default]\r\naws_access_key_id = ID\r\naws_secret_access_key=a/b+c=\naws_session_token = T\n");
  const absl::StatusOr<S3Credentials> credentials = ReadS3Credentials(path);
  ASSERT_TRUE(credentials.ok()) << credentials.status();
  EXPECT_EQ(credentials->access_key_id, "ID");
  EXPECT_EQ(credentials->secret_access_key, "a/b+c=");
  EXPECT_EQ(credentials->session_token, "T");
  PutFile(path, "[other]\naws_access_key_id = wrong\naws_secret_access_key = wrong\n");
  EXPECT_EQ(ErrorInfoOf(ReadS3Credentials(path).status()).reason, "S3_CREDENTIALS");
  EXPECT_EQ(ErrorInfoOf(ReadS3Credentials(directory.Path("none")).status()).reason, "S3_CREDENTIALS");
}

TEST(S3CredentialsTest, FromTheEnvironment) {
  setenv("AWS_ACCESS_KEY_ID", "ID", 1);
  unsetenv("AWS_SECRET_ACCESS_KEY");
  EXPECT_EQ(ErrorInfoOf(ReadS3Credentials("").status()).reason, "S3_CREDENTIALS");
  setenv("AWS_SECRET_ACCESS_KEY", "secret", 1);
  const absl::StatusOr<S3Credentials> credentials = ReadS3Credentials("");
  ASSERT_TRUE(credentials.ok()) << credentials.status();
  EXPECT_EQ(credentials->secret_access_key, "secret");
  EXPECT_EQ(credentials->session_token, "");
  unsetenv("AWS_ACCESS_KEY_ID");
  unsetenv("AWS_SECRET_ACCESS_KEY");
}

}  // namespace
}  // namespace planish
