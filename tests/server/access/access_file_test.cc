#include "server/access/access_file.h"

#include <sys/stat.h>
#include <unistd.h>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/access/access_source.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

// SHA-256 of "farm-token".
constexpr char kFarmDigest[] = "c1a4a80f23256e6b29fe356d47f92c2ff5ffcb992427ad43acbb862d3cf4e323";

std::string HexOf(const std::string& token) {
  std::string hex;
  for (const std::uint8_t byte : DigestOf(token)) {
    hex += "0123456789abcdef"[byte >> 4];
    hex += "0123456789abcdef"[byte & 15];
  }
  return hex;
}

std::string Full() {
  return R"(# who may use this server
tenants:
  lighting:
    share: 2.5
    queue: 200
    running: 4
    memory-mb: 8192
    store-mb: 2048
    credentials:
      - token-sha256: ")" +
         HexOf("farm-token") + R"("
        name: farm
        rights: [submit, jobs, admin]
        expires: 2027-01-01T00:00:00Z
      - certificate: Render-7.Studio
      - user: 1000
        rights: [all-jobs]
  fx_2:
    credentials:
      - token-sha256: )" +
         HexOf("fx-token") + R"(
  gone:
)";
}

absl::Status ErrorOf(const std::string& text) {
  return ParseAccessFile(text, "access.yaml").status();
}

TEST(TokenDigest, IsSha256) {
  EXPECT_EQ(HexOf("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(ParseTokenDigest("BA7816BF8F01CFEA414140DE5DAE2223B00361A396177A9CB410FF61F20015AD"), DigestOf("abc"));
  EXPECT_FALSE(ParseTokenDigest("ba78"));
  EXPECT_FALSE(ParseTokenDigest(std::string(63, 'a') + "g"));
  EXPECT_TRUE(IsEqual(DigestOf("abc"), DigestOf("abc")));
  EXPECT_FALSE(IsEqual(DigestOf("abc"), DigestOf("abd")));
  EXPECT_EQ(ShortName(DigestOf("abc")), "ba7816bf");
}

TEST(AccessFile, TenantsLimitsAndCredentials) {
  const auto table = ParseAccessFile(Full(), "access.yaml");
  ASSERT_TRUE(table.ok()) << table.status();
  EXPECT_EQ((*table)->tenants().size(), 3u);
  EXPECT_EQ((*table)->credentials(), 4u);
  EXPECT_EQ((*table)->LimitsOf("lighting"),
            (TenantLimits{2.5, 200, 4, std::int64_t{8192} << 20, std::int64_t{2048} << 20}));
  EXPECT_EQ((*table)->LimitsOf("fx_2"), TenantLimits());
  EXPECT_EQ((*table)->LimitsOf("nobody"), TenantLimits());

  const absl::Time now = absl::FromUnixSeconds(1'780'000'000);  // 2026
  const auto farm = (*table)->FindToken("farm-token", now);
  ASSERT_TRUE(farm.ok());
  EXPECT_EQ(farm->tenant, "lighting");
  EXPECT_EQ(farm->credential, "token farm");
  EXPECT_EQ(farm->rights, (Rights{true, true, false, true}));
  const auto fx = (*table)->FindToken("fx-token", now);
  ASSERT_TRUE(fx.ok());
  EXPECT_EQ(fx->credential, "token " + HexOf("fx-token").substr(0, 8));
  EXPECT_EQ(fx->rights, (Rights{true, true, false, false}));
  const auto render = (*table)->FindCertificate({"other.studio", "render-7.STUDIO"}, now);
  ASSERT_TRUE(render.ok());
  EXPECT_EQ(render->credential, "certificate render-7.studio");
  const auto user = (*table)->FindUser(1000, now);
  ASSERT_TRUE(user.ok());
  EXPECT_EQ(user->rights, (Rights{false, false, true, false}));
}

TEST(AccessFile, WrongAndExpiredCredentials) {
  const auto table = ParseAccessFile(Full(), "access.yaml");
  ASSERT_TRUE(table.ok());
  const absl::Time end = absl::FromUnixSeconds(1'798'761'600);  // 2027-01-01
  EXPECT_TRUE((*table)->FindToken("farm-token", end - absl::Seconds(1)).ok());
  const absl::Status expired = (*table)->FindToken("farm-token", end).status();
  EXPECT_EQ(expired.code(), absl::StatusCode::kUnauthenticated);
  EXPECT_THAT(expired.message(), HasSubstr("expired"));
  for (const absl::Status& wrong :
       {(*table)->FindToken("farm-toke", end).status(), (*table)->FindToken("", end).status(),
        (*table)->FindToken(HexOf("farm-token"), end).status(), (*table)->FindCertificate({}, end).status(),
        (*table)->FindCertificate({"render-7"}, end).status(), (*table)->FindUser(0, end).status()}) {
    EXPECT_EQ(wrong, CredentialsInvalid());
  }
}

TEST(AccessFile, ErrorsNameFileLineAndKey) {
  const std::string credential = "tenants:\n  a:\n    credentials:\n      - ";
  const std::string token = std::string("token-sha256: ") + kFarmDigest + "\n        ";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "access.yaml: expected \"key: value\" lines"},
      {"tenants:\n", "access.yaml:1: tenants: expected \"key: value\" lines"},
      {"tenants: {}\n", "access.yaml:1: tenants: there are none"},
      {"tenants:\n  a:\nusers: 1\n", "access.yaml:3: users: no such key; there are tenants"},
      {"tenants:\n  a: {}\n  a: {}\n", "access.yaml:3: tenants.a: is there twice"},
      {"tenants:\n  Big: {}\n", "access.yaml:2: tenants.Big: a tenant's name has"},
      {"tenants:\n  a:\n    shares: 2\n", "access.yaml:3: tenants.a.shares: no such key; there are share, queue"},
      {"tenants:\n  a:\n    share: 0\n", "access.yaml:3: tenants.a.share: expected a number above 0"},
      {"tenants:\n  a:\n    share: nan\n", "access.yaml:3: tenants.a.share: expected a number above 0"},
      {"tenants:\n  a:\n    running: 0\n", "tenants.a.running: expected a whole number from 1 to 1024, not 0"},
      {"tenants:\n  a:\n    queue: many\n", "tenants.a.queue: expected a whole number from 0 to 100000, not many"},
      {"tenants:\n  a:\n    credentials: 7\n", "access.yaml:3: tenants.a.credentials: expected a list"},
      {credential + "rights: [jobs]\n", "access.yaml:4: tenants.a.credentials[0]: expected exactly one of"},
      {credential + "user: 1\n        certificate: x\n", "access.yaml:4: tenants.a.credentials[0]: expected exactly"},
      {credential + "user: no-such-user-here\n", "tenants.a.credentials[0].user: this system has no user no-such"},
      {credential + token + "rights: [fly]\n", "access.yaml:5: tenants.a.credentials[0].rights[0]: unknown right: fly"},
      {credential + token + "rights: []\n", "access.yaml:5: tenants.a.credentials[0].rights: the list is empty"},
      {credential + token + "expires: soon\n", "access.yaml:5: tenants.a.credentials[0].expires: expected a time"},
      {credential + token + "until: soon\n", "access.yaml:5: tenants.a.credentials[0].until: no such key"},
      {credential + "user: 1\n      - user: 1\n",
       "access.yaml:5: tenants.a.credentials[1]: the same credential is at access.yaml:4: tenants.a.credentials[0]"},
      {"tenants: [\n", "access.yaml:2: "},
  };
  for (const auto& [text, message] : cases) {
    const absl::Status status = ErrorOf(text);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << text;
    EXPECT_THAT(std::string(status.message()), HasSubstr(message)) << text;
  }
}

TEST(AccessFile, ATokenInPlaceOfItsDigestIsNotRepeated) {
  const absl::Status status = ErrorOf("tenants:\n  a:\n    credentials:\n      - token-sha256: my-secret\n");
  EXPECT_THAT(std::string(status.message()), StartsWith("access.yaml:4: tenants.a.credentials[0].token-sha256: "));
  EXPECT_THAT(std::string(status.message()), Not(HasSubstr("my-secret")));
}

class AccessSourceTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& text, mode_t mode = 0600) {
    const std::string path = dir_.Path("access.yaml");
    PutFile(path, text);
    chmod(path.c_str(), mode);
    return path;
  }

  TempDir dir_;
};

TEST_F(AccessSourceTest, ReloadSwapsTheTableOrKeepsIt) {
  const std::string path = Write(Full());
  const auto source = AccessSource::Open(path);
  ASSERT_TRUE(source.ok()) << source.status();
  const std::shared_ptr<const AccessTable> before = (*source)->table();
  EXPECT_EQ(before->credentials(), 4u);
  Write("tenants:\n  other: {}\n");
  ASSERT_TRUE((*source)->Reload().ok());
  EXPECT_EQ((*source)->table()->credentials(), 0u);
  EXPECT_EQ(before->credentials(), 4u) << "who holds the old table keeps it";
  Write("tenants:\n  other: 3\n");
  EXPECT_THAT(std::string((*source)->Reload().message()), HasSubstr("access.yaml:2: tenants.other"));
  EXPECT_EQ((*source)->table()->tenants().count("other"), 1u);
}

TEST_F(AccessSourceTest, WhatIsPreparedIsNotYetInForce) {
  const auto source = AccessSource::Open(Write(Full()));
  ASSERT_TRUE(source.ok()) << source.status();
  Write("tenants:\n  other: {}\n");
  const auto put_in_force = (*source)->Prepare();
  ASSERT_TRUE(put_in_force.ok()) << put_in_force.status();
  EXPECT_EQ((*source)->table()->credentials(), 4u);
  (*put_in_force)();
  EXPECT_EQ((*source)->table()->credentials(), 0u);
}

TEST_F(AccessSourceTest, FilesThatOthersMayReadOrWrite) {
  EXPECT_THAT((*AccessSource::Open(Write(Full(), 0640)))->warnings(), IsEmpty());
  EXPECT_THAT((*AccessSource::Open(Write(Full(), 0644)))->warnings(), ElementsAre(HasSubstr("chmod o-r")));
  EXPECT_THAT(std::string(AccessSource::Open(Write(Full(), 0602)).status().message()), HasSubstr("can change it"));
}

TEST_F(AccessSourceTest, AFileThatIsNotThere) {
  const absl::Status status = AccessSource::Open(dir_.Path("none")).status();
  EXPECT_THAT(std::string(status.message()), HasSubstr("cannot read the access file"));
  EXPECT_THAT(std::string(status.message()), HasSubstr("No such file"));
}

}  // namespace
}  // namespace planish
