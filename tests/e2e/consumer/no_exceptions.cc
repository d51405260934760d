// Built with -fno-exceptions, as engines are: every error comes in a Result.
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "planish/admin.h"
#include "planish/client.h"
#include "planish/vertex_split.h"

#ifdef __cpp_exceptions
#error "this program is to be built without exceptions"
#endif

namespace {

void Require(bool condition, const char* what) {
  if (condition) return;
  std::fprintf(stderr, "not so: %s\n", what);
  std::exit(1);
}

template <typename T>
void RequireError(const planish::Result<T>& result, const std::string& reason) {
  Require(!result.ok() && result.error().reason() == reason, reason.c_str());
}

}  // namespace

int main(int, char** argv) {
  const std::vector<float> positions = {0, 0, 0, 1, 0, 0, 1, 1, 0.5, 0, 1, 0};
  const std::vector<std::uint32_t> triangles = {0, 1, 2, 0, 2, 3}, beyond = {0, 1, 9};
  const planish::MeshView mesh(positions, triangles);

  planish::PrivateServerOptions options;
  options.executable = "/nonexistent/planishd";
  RequireError(planish::PrivateServer::Make(options), "PRIVATE_SERVER_FAILED");
  planish::ClientOptions half;
  half.tls_key_file = "key.pem";
  RequireError(planish::Client::Make("h:1", half), "OPTIONS_INVALID");
  RequireError(planish::Client::Make("unix:/nonexistent")->GetCapabilities(std::nothrow), "SERVER_UNREACHABLE");
  RequireError(planish::AdminClient::Make("unix:/nonexistent")->Drain(std::nothrow), "SERVER_UNREACHABLE");

  options.executable = argv[1];
  const planish::Result<planish::PrivateServer> server = planish::PrivateServer::Make(options);
  Require(server.ok(), "planishd starts");
  planish::Result<planish::Client> client = planish::Client::Make(server->target());
  Require(client.ok(), "there is a client");

  std::atomic<int> events = 0;
  planish::Callbacks callbacks;
  callbacks.on_event = [&events](const planish::Event&) { ++events; };
  const planish::Result<planish::UnwrapResult> result = client->Unwrap(std::nothrow, mesh, {}, callbacks);
  Require(result.ok() && result->IsUsable() && events > 0, "a square is unwrapped");
  Require(result->uv.size() == 12, "with two numbers a corner");
  for (std::size_t i = 0; i < result->uv.size(); ++i) Require(std::isfinite(result->uv[i]), "that are numbers");
  const auto split = planish::SplitVertices(std::nothrow, 4, triangles, result->uv);
  Require(split.ok() && split->vertex_count() == 4, "and no seam");
  RequireError(planish::SplitVertices(std::nothrow, 3, triangles, result->uv), "MESH_INDEX_OUT_OF_RANGE");

  RequireError(client->Unwrap(std::nothrow, {positions, beyond}), "MESH_INDEX_OUT_OF_RANGE");
  RequireError(client->StartUnwrap(std::nothrow, {positions, beyond}), "MESH_INDEX_OUT_OF_RANGE");
  RequireError(client->GetJob(std::nothrow, "jobs/none"), "JOB_NOT_FOUND");
  RequireError(client->DeleteJob(std::nothrow, "jobs/none"), "JOB_NOT_FOUND");
  planish::UnwrapOptions wrong;
  wrong.texture_size = 1;
  planish::Result<planish::Call> call = client->StartUnwrap(std::nothrow, mesh, wrong);
  Require(call.ok(), "a call begins");
  RequireError(call->Wait(std::nothrow), "OPTIONS_INVALID");
  Require(client->DeleteJob(std::nothrow, result->job).ok(), "the job is deleted");
  return 0;
}
