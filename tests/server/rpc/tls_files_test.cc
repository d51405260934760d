#include "server/rpc/tls_files.h"

#include <sys/stat.h>

#include "absl/time/clock.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/testing/certificates.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class TlsFilesTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& text, mode_t mode = 0600) {
    const std::string path = dir_.Path(name);
    PutFile(path, text);
    chmod(path.c_str(), mode);
    return path;
  }

  std::string ErrorOf(const TlsFiles& files) {
    const auto loaded = LoadTlsFiles(files, now_);
    EXPECT_EQ(loaded.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(loaded.status().message());
  }

  IssuedCertificate Valid(absl::Time begin, absl::Time end) {
    CertificateRequest request;
    request.common_name = "server";
    request.not_before = begin;
    request.not_after = end;
    return authority_.Issue(request);
  }

  TempDir dir_;
  const absl::Time now_ = absl::Now();
  TestAuthority authority_;
  IssuedCertificate server_ = IssueLocal(authority_);
  std::string cert_ = Write("cert.pem", server_.certificate + authority_.certificate());
  std::string key_ = Write("key.pem", server_.key);
};

TEST_F(TlsFilesTest, GoodFiles) {
  const std::string ca = Write("ca.pem", authority_.certificate(), 0644);
  const auto loaded = LoadTlsFiles({cert_, key_, ca}, now_);
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_EQ(loaded->key, server_.key);
  EXPECT_EQ(loaded->certificate, server_.certificate + authority_.certificate());
  EXPECT_EQ(loaded->client_ca, authority_.certificate());
  EXPECT_THAT(loaded->warnings, IsEmpty());
  EXPECT_EQ(loaded->not_after, CertificateEnd(server_.certificate));
  EXPECT_NEAR(absl::ToDoubleHours(loaded->not_after - now_), 24 * 30, 1);
}

TEST_F(TlsFilesTest, FilesThatAreNoneAreNamed) {
  const std::string none = dir_.Path("none");
  EXPECT_THAT(ErrorOf({none, key_, ""}), HasSubstr("cannot read the certificate " + none + ": No such file"));
  EXPECT_THAT(ErrorOf({cert_, none, ""}), HasSubstr("cannot read the key " + none));
  EXPECT_THAT(ErrorOf({cert_, key_, none}), HasSubstr("cannot read the clients' CA " + none));
  // These said "Success" where the file could be opened.
  const std::string empty = Write("empty", "");
  EXPECT_EQ(ErrorOf({empty, key_, ""}), empty + ": no certificate in PEM");
  const std::string folder = std::string(dir_.Path("."));
  EXPECT_EQ(ErrorOf({folder, key_, ""}), "cannot read the certificate " + folder + ": Is a directory");
  const std::string text = Write("text", "hello\n");
  EXPECT_EQ(ErrorOf({text, key_, ""}), text + ": no certificate in PEM");
  EXPECT_EQ(ErrorOf({cert_, text, ""}), text + ": no private key in PEM");
  EXPECT_EQ(ErrorOf({cert_, key_, text}), text + ": no certificate in PEM");
  EXPECT_THAT(ErrorOf({cert_, Write("locked", EncryptedKey(server_)), ""}), HasSubstr("the key is encrypted"));
}

TEST_F(TlsFilesTest, ACertificateOfAnotherKey) {
  const std::string other = Write("other.pem", IssueLocal(authority_).key);
  EXPECT_EQ(ErrorOf({cert_, other, ""}), "the certificate in " + cert_ + " does not belong to the key in " + other);
}

TEST_F(TlsFilesTest, DatesOfCertificates) {
  const auto write = [this](const IssuedCertificate& issued) {
    return TlsFiles{Write("c", issued.certificate), Write("k", issued.key), ""};
  };
  const absl::Duration day = absl::Hours(24);
  EXPECT_THAT(ErrorOf(write(Valid(now_ - 2 * day, now_ - day))), HasSubstr("the certificate expired at 20"));
  EXPECT_THAT(ErrorOf(write(Valid(now_ + day, now_ + 2 * day))), HasSubstr("is valid from 20"));
  const auto soon = LoadTlsFiles(write(Valid(now_ - day, now_ + day)), now_);
  ASSERT_TRUE(soon.ok());
  EXPECT_THAT(soon->warnings, ElementsAre(HasSubstr("the certificate expires at 20")));
}

TEST_F(TlsFilesTest, AKeyThatEverybodyMayRead) {
  const auto loaded = LoadTlsFiles({cert_, Write("open.pem", server_.key, 0644), ""}, now_);
  ASSERT_TRUE(loaded.ok());
  EXPECT_THAT(loaded->warnings, ElementsAre(HasSubstr("chmod o-rw " + dir_.Path("open.pem"))));
}

}  // namespace
}  // namespace planish
