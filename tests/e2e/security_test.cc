// The command against a server with TLS and an access file, with what deploy/certificates.sh makes.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <memory>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "planish/client.h"
#include "tests/e2e/command.h"
#include "tests/e2e/meshes.h"

namespace planish::testing {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

class SecurityTest : public ::testing::Test {
 protected:
  SecurityTest() {
    if (RunShell("command -v openssl").exit_code == 0) certificates_made_ = RunShell(Script()).exit_code == 0;
  }

  void SetUp() override {
    if (RunShell("command -v openssl").exit_code != 0) GTEST_SKIP() << "openssl is not installed";
    ASSERT_TRUE(certificates_made_);
  }

  std::string Script() const {
    return PLANISH_SOURCE_TREE "/deploy/certificates.sh " + File("") + " localhost 127.0.0.1";
  }
  std::string File(const std::string& name) const { return directory_.Path("tls/" + name); }
  std::string Address() const { return "127.0.0.1:" + std::to_string(port_); }

  void Start(const std::vector<std::string>& flags) {
    std::vector<std::string> more = {"--listen=" + Address()};
    more.insert(more.end(), flags.begin(), flags.end());
    server_ = std::make_unique<PrivateServer>(ServerOptions(1, more));
  }

  void StartSecure(std::vector<std::string> flags = {}) {
    flags.push_back("--tls-cert=" + File("server.pem"));
    flags.push_back("--tls-key=" + File("server-key.pem"));
    flags.push_back("--access-file=" + File("access.yaml"));
    Start(flags);
  }

  Outcome Run(std::vector<std::string> words, const std::map<std::string, std::string>& environment = {}) const {
    words.push_back("--server=" + Address());
    return Planish(words, environment);
  }
  Outcome Version(std::vector<std::string> flags, const std::map<std::string, std::string>& environment = {}) const {
    flags.insert(flags.begin(), "version");
    return Run(flags, environment);
  }

  std::string Ca() const { return "--tls-ca=" + File("ca.pem"); }
  std::string Token() const { return "--token-file=" + File("token"); }

  TempDir directory_;
  const int port_ = FreePort();
  bool certificates_made_ = false;
  std::unique_ptr<PrivateServer> server_;
};

TEST_F(SecurityTest, CertificatesAreMadeOnceAndForFewOnly) {
  const std::string token = ReadFile(File("token"));
  EXPECT_EQ(token.size(), 65u);
  const std::string certificate = ReadFile(File("server.pem"));
  EXPECT_EQ(RunShell(Script()).exit_code, 0);
  EXPECT_EQ(ReadFile(File("token")), token);
  EXPECT_EQ(ReadFile(File("server.pem")), certificate);
  std::filesystem::remove(File("server.pem"));
  EXPECT_EQ(RunShell(Script()).exit_code, 0);
  EXPECT_NE(ReadFile(File("server.pem")), certificate);
  EXPECT_EQ(ReadFile(File("token")), token);
  for (const auto& entry : std::filesystem::directory_iterator(File(""))) {
    struct stat info = {};
    ASSERT_EQ(stat(entry.path().c_str(), &info), 0);
    // What the server reads is for the owner's group as well: a container's user is let into it.
    const std::string name = entry.path().filename();
    const bool is_servers =
        name == "server.pem" || name == "server-key.pem" || name == "ca.pem" || name == "access.yaml";
    EXPECT_EQ(info.st_mode & 0777, is_servers ? 0640u : 0600u) << entry.path();
  }
  EXPECT_THAT(ReadFile(File("access.yaml")), Not(HasSubstr(token.substr(0, 64))));
  EXPECT_NE(RunShell(PLANISH_SOURCE_TREE "/deploy/certificates.sh " + File("") + " 'a b'").exit_code, 0);
}

TEST_F(SecurityTest, UnwrapsWithTokenOverTls) {
  StartSecure();
  const std::string mesh = directory_.Path("grid.obj");
  PutFile(mesh, GridObj(6));
  const Outcome run = Run({"unwrap", mesh, "-o", directory_.Path("out.obj"), "--json", Ca(), Token()});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(json::parse(run.out)["state"], "SUCCEEDED");
  const Outcome list = Run(
      {"jobs", "list"}, {{"PLANISH_TLS_CA", File("ca.pem")}, {"PLANISH_TOKEN", ReadFile(File("token")).substr(0, 64)}});
  EXPECT_EQ(list.exit_code, 0) << list.err;
  EXPECT_THAT(list.out, HasSubstr("jobs/"));
}

TEST_F(SecurityTest, CredentialsThatDoNotDo) {
  StartSecure();
  const Outcome none = Version({Ca()});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("this server needs credentials"));
  EXPECT_THAT(none.err, HasSubstr("--token-file"));
  const Outcome wrong = Version({Ca()}, {{"PLANISH_TOKEN", "guess"}});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("does not know these credentials"));
  const Outcome no_file = Version({Ca(), "--token-file=" + File("none")});
  EXPECT_EQ(no_file.exit_code, 2);
  EXPECT_THAT(no_file.err, HasSubstr("cannot read the token"));
}

TEST_F(SecurityTest, WhatIsWrongWithTlsIsSaid) {
  StartSecure();
  const Outcome plain = Version({});
  EXPECT_EQ(plain.exit_code, 3);
  EXPECT_THAT(plain.err, HasSubstr("speaks TLS only"));
  EXPECT_THAT(plain.err, HasSubstr("hint: --tls"));
  const Outcome unknown = Version({"--tls"}, {{"PLANISH_TOKEN_FILE", File("token")}});
  EXPECT_EQ(unknown.exit_code, 3);
  EXPECT_THAT(unknown.err, HasSubstr("the server's certificate cannot be trusted"));
  const Outcome name = Version({Ca(), "--tls-server-name=farm.example"});
  EXPECT_EQ(name.exit_code, 3);
  EXPECT_THAT(name.err, HasSubstr("certificate is not for farm.example"));
  const Outcome half = Version({Ca(), "--tls-cert=" + File("client.pem")});
  EXPECT_EQ(half.exit_code, 2);
  EXPECT_THAT(half.err, HasSubstr("takes two files"));
}

TEST_F(SecurityTest, TlsToAServerWithout) {
  Start({});
  const Outcome run = Version({Ca()});
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_THAT(run.err, HasSubstr("does not speak TLS"));
  EXPECT_EQ(Version({}).exit_code, 0);
}

TEST_F(SecurityTest, ClientCertificates) {
  StartSecure({"--tls-client-ca=" + File("ca.pem")});
  const std::vector<std::string> mine = {Ca(), "--tls-cert=" + File("client.pem"),
                                         "--tls-key=" + File("client-key.pem")};
  EXPECT_EQ(Version(mine).exit_code, 0) << Version(mine).err;
  const Outcome none = Version({Ca(), Token()});
  EXPECT_EQ(none.exit_code, 3);
  EXPECT_THAT(none.err, HasSubstr("asks for a client certificate"));
  // Signed by the same authority, but not for clients.
  const Outcome other = Version({Ca(), "--tls-cert=" + File("server.pem"), "--tls-key=" + File("server-key.pem")});
  EXPECT_EQ(other.exit_code, 3);
  EXPECT_THAT(other.err, HasSubstr("refuses the client certificate"));
}

TEST_F(SecurityTest, FilesThatChangeAreNoticed) {
  StartSecure();
  ASSERT_EQ(Version({Ca(), Token()}).exit_code, 0);
  // A new token: the old one is revoked within a second.
  const std::string old_token = ReadFile(File("token")).substr(0, 64);
  std::filesystem::remove(File("token"));
  std::filesystem::remove(File("access.yaml"));
  ASSERT_EQ(RunShell(Script()).exit_code, 0);
  for (const double end = Now() + 20; Now() < end && Version({Ca(), Token()}).exit_code != 0;) usleep(50'000);
  EXPECT_EQ(Version({Ca(), Token()}).exit_code, 0);
  EXPECT_EQ(Version({Ca()}, {{"PLANISH_TOKEN", old_token}}).exit_code, 2);
  // A new authority, and a server certificate by it.
  for (const char* name : {"ca.pem", "ca-key.pem", "server.pem"}) std::filesystem::remove(File(name));
  ASSERT_EQ(RunShell(Script()).exit_code, 0);
  for (const double end = Now() + 20; Now() < end && Version({Ca(), Token()}).exit_code != 0;) usleep(50'000);
  EXPECT_EQ(Version({Ca(), Token()}).exit_code, 0);
  // What is wrong is logged and ignored.
  PutFile(File("access.yaml"), "tenants: 3\n");
  for (const double end = Now() + 20; Now() < end && server_->log().find("tenants: expected") == std::string::npos;) {
    usleep(50'000);
  }
  EXPECT_THAT(server_->log(), HasSubstr("access.yaml:1: tenants: expected"));
  EXPECT_EQ(Version({Ca(), Token()}).exit_code, 0);
}

TEST_F(SecurityTest, ATokenStaysOffOtherMachinesWithoutTls) {
  const Outcome run = Planish({"version", "--server=192.0.2.1:7741", Token()});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("unencrypted"));
  EXPECT_LT(run.seconds, 5);
}

}  // namespace
}  // namespace planish::testing
