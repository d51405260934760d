#include "tests/house/include_rules.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace planish::house {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

std::vector<SourceFile> Sources() {
  return ReadSources(Root(), {".cc", ".h"});
}

TEST(IncludeRules, TheTreeKeepsThem) {
  const std::vector<SourceFile> sources = Sources();
  ASSERT_GT(sources.size(), 10u);
  const std::vector<std::string> broken = FindBrokenRules(sources, sources);
  for (const std::string& sentence : broken) ADD_FAILURE() << sentence;
}

struct Planted {
  std::string path;
  std::string include;
  std::string sentence;  // part of the complaint
};

const std::vector<Planted>& PlantedViolations() {
  static const auto* planted = new std::vector<Planted>{
      {"core/base/x.h", "#include \"core/mesh/mesh.h\"", "core/base must not include core/mesh"},
      {"core/linalg/x.h", "#include \"core/mesh/mesh.h\"", "core/linalg must not include core/mesh"},
      {"core/mesh/x.h", "#include \"core/linalg/x.h\"", "core/mesh must not include core/linalg"},
      {"core/abf/x.cc", "#include \"core/unwrap/unwrap.h\"", "core/abf must not include core/unwrap"},
      {"core/unwrap/x.cc", "#include \"core/draco/codec.h\"", "core/unwrap must not include core/draco"},
      {"core/draco/x.cc", "#include \"core/abf/flatten.h\"", "core/draco must not include core/abf"},
      {"client/files/x.cc", "#include \"core/unwrap/unwrap.h\"", "client/files must not include core/unwrap"},
      {"client/files/x.cc", "#include \"draco/mesh/mesh.h\"", "client/files must not include Draco"},
      {"client/files/x.cc", "#include \"client/pictures/canvas.h\"", "client/files must not include client/pictures"},
      {"server/worker/x.cc", "#include \"client/files/mesh_file.h\"", "server/worker must not include client"},
      {"core/draco/x.cc", "#include \"planish/v1/job.pb.h\"", "core/draco must not include planish/v1"},
      {"core/abf/x.cc", "  #  include <grpcpp/grpcpp.h>", "core/abf must not include gRPC"},
      {"core/abf/x.cc", "#include <google/protobuf/message.h>", "core/abf must not include protobuf"},
      {"core/base/x.cc", "#include <sys/socket.h>", "core/base must not include sockets"},
      {"core/mesh/x.cc", "#include <OpenMesh/Core/IO/MeshIO.hh>  // why", "must not include OpenMesh"},
      {"core/abf/x.cc", "#include <suitesparse/cholmod.h>", "core/abf must not include BLAS, CHOLMOD and OpenMP"},
      {"core/new/x.cc", "#include <vector>", "no rule says what this folder may include"},
      {"server/jobs/x.cc", "#include \"grpcpp/server.h\"", "server/jobs must not include gRPC"},
      {"server/jobs/x.cc", "#include \"planish/v1/planish.grpc.pb.h\"", "server/jobs must not include gRPC"},
      {"server/jobs/x.cc", "#include \"server/rpc/x.h\"", "server/jobs must not include server/rpc"},
      {"server/rpc/x.cc", "#include \"core/unwrap/unwrap.h\"", "server/rpc must not include core/unwrap"},
      {"server/rpc/x.cc", "#include \"draco/mesh/mesh.h\"", "server/rpc must not include Draco"},
      {"server/worker/x.cc", "#include \"server/jobs/job_runner.h\"", "server/worker must not include server/jobs"},
      {"server/link/x.cc", "#include \"server/jobs/job_runner.h\"", "server/link must not include server/jobs"},
      {"client/include/planish/x.h", "#include \"planish/v1/job.pb.h\"", "must not include planish/v1"},
      {"client/include/planish/x.h", "#include <absl/status/status.h>", "the standard library only"},
      {"client/include/planish/x.h", "#include <stdint.h>", "the standard library only"},
      {"client/src/x.cc", "#include \"core/abf/flatten.h\"", "client/src must not include core/abf"},
      {"client/src/x.cc", "#include \"server/jobs/x.h\"", "client/src must not include server"},
      {"client/src/x.cc", "#include <sys/mman.h>", "client/src must not include headers of the system"},
      {"client/src/x.cc", "#include <poll.h>", "client/src must not include headers of the system"},
      {"client/cli/x.cc", "#include \"planish/v1/job.pb.h\"", "client/cli must not include planish/v1"},
      {"client/cli/x.cc", "#include \"client/src/rpc.h\"", "client/cli must not include client/src/rpc.h"},
      {"client/cli/x.cc", "#include <grpcpp/channel.h>", "client/cli must not include gRPC"},
      {"core/abf/x.cc", "#include \"flatten.h\"", "paths start at the root of the repository"},
      {"core/abf/x.cc", "#include \"core/base/gone.h\"", "there is no core/base/gone.h"}};
  return *planted;
}

TEST(IncludeRules, PlantedViolationsAreFound) {
  const std::vector<SourceFile> sources = Sources();
  for (const Planted& planted : PlantedViolations()) {
    const SourceFile file = {planted.path, "// A comment.\n#pragma once\n" + planted.include + "\nint x;\n"};
    EXPECT_THAT(FindBrokenRules({file}, sources),
                ElementsAre(AllOf(StartsWith(planted.path + ":3: "), HasSubstr(planted.sentence))))
        << planted.path << " with " << planted.include;
  }
}

TEST(IncludeRules, WhatIsAllowedPasses) {
  const SourceFile server = {"server/worker/x.cc",
                             "#include \"core/unwrap/unwrap.h\"\n#include \"planish/worker/v1/worker.pb.h\"\n"};
  const SourceFile header = {"client/include/planish/x.h", "#include <string>\n// #include <grpcpp/grpcpp.h>\n"};
  EXPECT_THAT(FindBrokenRules({server, header}, Sources()), IsEmpty());
}

}  // namespace
}  // namespace planish::house
