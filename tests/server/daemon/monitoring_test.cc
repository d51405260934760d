// A planishd that did all sorts of work, looked at from outside.
#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <regex>
#include <thread>

#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "core/draco/codec.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/generic/generic_stub.h"
#include "gtest/gtest.h"
#include "planish/v1/planish.grpc.pb.h"
#include "server/metrics/definitions.h"
#include "tests/server/daemon/monitoring_files.h"
#include "tests/testing/certificates.h"
#include "tests/testing/daemon.h"
#include "tests/testing/files.h"
#include "tests/testing/http_get.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr char kTraceId[] = "0af7651916cd43dd8448eb211c80319c";
const std::string kTraceparent = std::string("00-") + kTraceId + "-b7ad6b7169203331-01";

class Watched {
 public:
  explicit Watched(std::vector<std::string> flags) {
    flags.insert(flags.end(), {"--listen=unix:" + dir_.Path("s"), "--metrics-listen=127.0.0.1:0", "--failpoints"});
    daemon_ = std::make_unique<Daemon>(std::move(flags), true);
    EXPECT_TRUE(daemon_->WaitReady());
    const std::string said = "metrics and probes at ";
    const std::string log = daemon_->ReadUntil(said);
    const std::size_t at = log.find(said);
    EXPECT_NE(at, std::string::npos) << log;
    if (at != std::string::npos) {
      http_ = log.substr(at + said.size(), log.find('\n', at) - at - said.size());
    }
    channel_ = grpc::CreateChannel("unix:" + dir_.Path("s"), grpc::InsecureChannelCredentials());
    stub_ = v1::Planish::NewStub(channel_);
  }

  Daemon& daemon() { return *daemon_; }
  v1::Planish::Stub& stub() { return *stub_; }
  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }
  std::string Path(const std::string& name) const { return dir_.Path(name); }

  std::string Get(const std::string& path) const { return HttpGet(http_, path).body; }
  int Status(const std::string& path) const { return HttpGet(http_, path).status; }
  // Asks again until `path` answers so.
  bool WaitForStatus(const std::string& path, int status) const {
    for (int i = 0; i < 1000; ++i) {
      if (Status(path) == status) return true;
      std::this_thread::yield();
    }
    return false;
  }

  grpc::Status Create(const v1::CreateJobRequest& request, v1::Job* job, const std::string& failpoint = "",
                      const std::string& traceparent = "") {
    grpc::ClientContext context;
    if (!failpoint.empty()) context.AddMetadata("planish-failpoint", failpoint);
    if (!traceparent.empty()) context.AddMetadata("traceparent", traceparent);
    return stub_->CreateJob(&context, request, job);
  }

  v1::Job Follow(const std::string& name) {
    grpc::ClientContext context;
    v1::WatchJobRequest request;
    request.set_name(name);
    const auto reader = stub_->WatchJob(&context, request);
    v1::Job job;
    for (v1::WatchJobResponse response; reader->Read(&response);) {
      if (response.event().has_job()) job = response.event().job();
    }
    EXPECT_TRUE(reader->Finish().ok());
    return job;
  }

  v1::Job Run(const v1::CreateJobRequest& request, const std::string& failpoint = "") {
    v1::Job job;
    const grpc::Status status = Create(request, &job, failpoint);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return Follow(job.name());
  }

 private:
  TempDir dir_;
  std::unique_ptr<Daemon> daemon_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::Planish::Stub> stub_;
  std::string http_;
};

// How many lines of numbers /metrics has.
std::ptrdiff_t SeriesCount(const Watched& server) {
  const std::string text = server.Get("/metrics");
  return std::count(text.begin(), text.end(), '\n');
}

v1::CreateJobRequest RequestOf(const Mesh& mesh) {
  v1::CreateJobRequest request;
  request.mutable_spec()->set_draco(*EncodeDraco(mesh));
  return request;
}

// Three triangles on one edge.
Mesh Fan() {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}};
  mesh.faces = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}};
  return mesh;
}

// The server, and its scrape after: jobs that succeed, one that took its result from another, one with a warning, one
// that fails, one that costs two workers, refused calls, uploads.
class BusyServer : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    server_ = std::make_unique<Watched>(std::vector<std::string>{"--workers=2", "--threads=1"});
    const v1::CreateJobRequest good = RequestOf(Bump(8));
    EXPECT_EQ(server_->Run(good).state(), v1::JOB_STATE_SUCCEEDED);
    EXPECT_EQ(server_->Run(good).state(), v1::JOB_STATE_SUCCEEDED);

    v1::CreateJobRequest odd = RequestOf(Fan());
    odd.mutable_spec()->mutable_scheduling()->set_priority(v1::PRIORITY_HIGH);
    EXPECT_EQ(server_->Run(odd).report().warnings(0).reason(), "EDGES_NON_MANIFOLD");

    v1::CreateJobRequest closed = RequestOf(Tetrahedron());
    closed.mutable_spec()->mutable_options()->set_seams(v1::SEAMS_NONE);
    EXPECT_EQ(server_->Run(closed).state(), v1::JOB_STATE_FAILED);

    EXPECT_EQ(server_->Run(RequestOf(Bump(10)), "solve=abort").state(), v1::JOB_STATE_FAILED);

    v1::Job job;
    v1::CreateJobRequest nonsense = good;
    nonsense.mutable_spec()->mutable_options()->set_tolerance(-1);
    EXPECT_FALSE(server_->Create(nonsense, &job).ok());
    EXPECT_FALSE(server_->Create({}, &job).ok());

    UnwrapWithUv(RequestOf(Bump(7)).spec().draco());
    Upload(RequestOf(Bump(11)).spec().draco());
    Upload(RequestOf(Bump(11)).spec().draco());
    text_ = server_->Get("/metrics");
    scrape_ = ParseScrape(text_);
    PutFile(ScrapeFile(), text_);
  }
  static void TearDownTestSuite() { server_.reset(); }

  static void UnwrapWithUv(const std::string& draco) {
    grpc::ClientContext context;
    v1::UnwrapRequest request;
    request.mutable_spec()->set_draco(draco);
    const auto reader = server_->stub().Unwrap(&context, request);
    for (v1::UnwrapResponse response; reader->Read(&response);) {
    }
    EXPECT_TRUE(reader->Finish().ok());
  }

  static void Upload(const std::string& draco) {
    v1::CreateUploadRequest request;
    request.set_total_bytes(static_cast<std::int64_t>(draco.size()));
    request.set_sha256(Sha256(draco));
    v1::Upload upload;
    grpc::ClientContext context;
    EXPECT_TRUE(server_->stub().CreateUpload(&context, request, &upload).ok());
    if (upload.committed_bytes() == upload.total_bytes()) return;
    grpc::ClientContext write_context;
    const auto writer = server_->stub().WriteUpload(&write_context, &upload);
    v1::WriteUploadRequest piece;
    piece.set_name(upload.name());
    piece.set_data(draco);
    writer->Write(piece);
    writer->WritesDone();
    EXPECT_TRUE(writer->Finish().ok());
  }

  static double Value(const std::string& sample) {
    const auto found = scrape_.values.find(sample);
    EXPECT_NE(found, scrape_.values.end()) << sample;
    return found == scrape_.values.end() ? -1 : found->second;
  }

  static std::string ScrapeFile() { return server_->Path("scrape.txt"); }

  static inline std::unique_ptr<Watched> server_;
  static inline std::string text_;
  static inline Scrape scrape_;
};

TEST_F(BusyServer, CountsWhatItDid) {
  EXPECT_EQ(Value(R"(planish_jobs_accepted_total{priority="normal",tenant="default"})"), 5);
  EXPECT_EQ(Value(R"(planish_jobs_accepted_total{priority="high",tenant="default"})"), 1);
  EXPECT_EQ(Value(R"(planish_jobs_ended_total{reason="NONE",state="succeeded",tenant="default"})"), 4);
  EXPECT_EQ(Value(R"(planish_jobs_ended_total{reason="MESH_CLOSED",state="failed",tenant="default"})"), 1);
  EXPECT_EQ(Value(R"(planish_jobs_ended_total{reason="WORKER_CRASHED",state="failed",tenant="default"})"), 1);
  EXPECT_EQ(Value(R"(planish_job_retries_total{reason="WORKER_CRASHED"})"), 2);
  EXPECT_EQ(Value(R"(planish_worker_ends_total{cause="crashed"})"), 3);
  EXPECT_GE(Value(R"(planish_worker_starts_total{result="ok"})"), 3);
  EXPECT_EQ(Value(R"(planish_cache_hits_total{kind="kept_result"})"), 1);
  EXPECT_EQ(Value(R"(planish_cache_hits_total{kind="upload"})"), 1);
  EXPECT_EQ(Value(R"(planish_rejections_total{call="CreateJob",reason="OPTIONS_INVALID"})"), 1);
  EXPECT_EQ(Value(R"(planish_rejections_total{call="CreateJob",reason="MESH_MISSING"})"), 1);
  EXPECT_EQ(Value(R"(planish_job_warnings_total{reason="EDGES_NON_MANIFOLD"})"), 1);
  EXPECT_EQ(Value(R"(planish_calls_total{call="CreateJob",code="OK"})"), 5);
  EXPECT_EQ(Value(R"(planish_calls_total{call="CreateJob",code="INVALID_ARGUMENT"})"), 2);
  EXPECT_EQ(Value(R"(planish_queue_wait_seconds_count{priority="normal"})"), 4) << "a kept result starts no worker";
  EXPECT_EQ(Value("planish_job_triangles_count"), 3) << "of work that was delivered";
  EXPECT_EQ(Value("planish_job_triangles_sum"), 2 * 64 + 3 + 2 * 49);
  EXPECT_GT(Value("planish_job_newton_iterations_sum"), 0);
  EXPECT_EQ(Value(R"(planish_stage_seconds_count{stage="solve"})"), 3);
  EXPECT_EQ(Value("planish_uv_sent_bytes_total"), 2 * 49 * 3 * 2 * 4) << "of the one that streamed them";
  EXPECT_EQ(Value("planish_upload_received_bytes_total"),
            static_cast<double>(RequestOf(Bump(11)).spec().draco().size()));
  EXPECT_GT(Value(R"(planish_tenant_run_seconds_total{tenant="default"})"), 0);
  EXPECT_LT(Value(R"(planish_tenant_run_seconds_total{tenant="default"})"), 3600);
  EXPECT_GT(Value("planish_store_bytes"), 0);
  EXPECT_EQ(Value("planish_workers"), 2);
  EXPECT_EQ(Value("planish_ready"), 1);
  EXPECT_EQ(Value("planish_streams_open"), 0);
  EXPECT_EQ(Value(R"(planish_jobs_running{tenant="default"})"), 0);
  EXPECT_EQ(Value("planish_memory_reserved_bytes"), 0);
}

// Both ways: nothing undocumented, nothing documented that is not there.
TEST_F(BusyServer, ServesWhatIsDocumented) {
  std::set<std::string> documented, served;
  for (const MetricDefinition* metric : AllMetrics()) {
    const std::string name = metric->name;
    SCOPED_TRACE(name);
    documented.insert(name);
    EXPECT_TRUE(scrape_.help.contains(name));
    EXPECT_EQ(scrape_.types[name], NameOf(metric->kind));
    std::string labels;
    const bool is_histogram = metric->kind == MetricKind::kHistogram;
    for (const std::string& label : scrape_.samples[is_histogram ? name + "_sum" : name]) {
      labels += (labels.empty() ? "" : ", ") + label;
      EXPECT_THAT(metric->labels, HasSubstr(label));
    }
    EXPECT_EQ(labels.size(), std::string(metric->labels).size()) << labels;
  }
  for (const auto& [name, help] : scrape_.help) served.insert(name);
  EXPECT_EQ(served, documented);
  for (const auto& [sample, labels] : scrape_.samples) {
    const std::string name = std::regex_replace(sample, std::regex("_(bucket|sum|count)$"), "");
    EXPECT_TRUE(documented.contains(sample) || scrape_.types[name] == "histogram") << sample;
  }
}

TEST_F(BusyServer, DashboardAndRulesFindWhatTheyAskFor) {
  std::vector<std::string> expressions = ExpressionsOfRules(PLANISH_SOURCE_TREE "/deploy/monitoring/planish.rules.yml");
  EXPECT_GT(expressions.size(), 15U);
  for (const std::string& each :
       ExpressionsOfDashboard(PLANISH_SOURCE_TREE "/deploy/monitoring/planish.dashboard.json")) {
    expressions.push_back(each);
  }
  EXPECT_GT(expressions.size(), 60U);
  std::set<std::string> asked;
  for (const std::string& expression : expressions) {
    for (const Selector& selector : SelectorsOf(expression)) {
      SCOPED_TRACE(expression);
      asked.insert(std::regex_replace(selector.name, std::regex("_(bucket|sum|count)$"), ""));
      const auto sample = scrape_.samples.find(selector.name);
      if (sample == scrape_.samples.end()) {
        ADD_FAILURE() << "no " << selector.name << " in the scrape";
        continue;
      }
      for (const std::string& label : selector.labels) {
        if (label == "instance" || label == "job") continue;  // Prometheus adds these
        EXPECT_TRUE(sample->second.contains(label)) << selector.name << " has no label " << label;
      }
    }
  }
  std::vector<std::string> unused;
  for (const MetricDefinition* metric : AllMetrics()) {
    if (!asked.contains(metric->name)) unused.push_back(metric->name);
  }
  EXPECT_THAT(unused, IsEmpty()) << "no panel and no rule shows them";
}

bool HasPromtool() {
  return RunShell("command -v promtool").exit_code == 0;
}
constexpr char kNoPromtool[] = "promtool is not installed (Debian package prometheus)";

// What it prints if it finds something wrong.
std::string Promtool(const std::string& arguments) {
  const Outcome run = RunShell("promtool " + arguments + " 2>&1");
  return run.exit_code == 0 ? "" : "promtool " + arguments + ":\n" + run.out;
}

TEST_F(BusyServer, PromtoolFindsNoFaultWithTheScrape) {
  if (!HasPromtool()) GTEST_SKIP() << kNoPromtool;
  EXPECT_EQ(Promtool("check metrics < " + ScrapeFile()), "");
}

TEST(Rules, PromtoolFindsNoFaultAndTheyAlarmWhenTheyShould) {
  if (!HasPromtool()) GTEST_SKIP() << kNoPromtool;
  EXPECT_EQ(Promtool("check rules " PLANISH_SOURCE_TREE "/deploy/monitoring/planish.rules.yml"), "");
  EXPECT_EQ(Promtool("check config " PLANISH_SOURCE_TREE "/deploy/monitoring/prometheus.yml"), "");
  EXPECT_EQ(Promtool("test rules " PLANISH_SOURCE_TREE "/deploy/monitoring/planish.rules.test.yml"), "");
}

// ---- probes, and scrapes under load

TEST(Watching, ProbesThroughADrain) {
  Watched server({"--workers=1", "--grace=20"});
  EXPECT_EQ(server.Status("/livez"), 200);
  EXPECT_EQ(server.Get("/readyz"), "ready\n");
  v1::CreateJobRequest endless = RequestOf(Bump(100));
  endless.mutable_spec()->mutable_options()->set_solver(v1::SOLVER_MINRES);
  endless.mutable_spec()->mutable_options()->set_system(v1::SYSTEM_FULL);
  endless.mutable_spec()->mutable_options()->set_preconditioner(v1::PRECONDITIONER_NONE);
  v1::Job job;
  ASSERT_TRUE(server.Create(endless, &job).ok());
  server.daemon().Signal(SIGTERM);
  EXPECT_TRUE(server.WaitForStatus("/readyz", 503));
  EXPECT_THAT(server.Get("/readyz"), HasSubstr("takes no new jobs"));
  EXPECT_EQ(server.Status("/livez"), 200);
  EXPECT_THAT(server.Get("/metrics"), HasSubstr("\nplanish_draining 1\n"));
  server.daemon().Signal(SIGTERM);  // ends the grace
  EXPECT_EQ(server.daemon().Wait(), 0);
}

// Workers that are threads compute in the process that answers scrapes.
TEST(Watching, ScrapesWhileWorkersComputeInTheSameProcess) {
  Watched server({"--workers=2", "--threads=1", "--isolation=thread"});
  std::atomic<bool> done = false;
  std::atomic<int> answers = 0, others = 0;
  std::vector<std::jthread> scrapers;
  for (int i = 0; i < 6; ++i) {
    scrapers.emplace_back([&] {
      while (!done) ++(server.Get("/metrics").find("\nplanish_ready 1\n") == std::string::npos ? others : answers);
    });
  }
  for (int n = 20; n < 26; ++n) {
    v1::CreateJobRequest direct = RequestOf(Bump(n));
    direct.mutable_spec()->mutable_options()->set_solver(v1::SOLVER_DIRECT);
    EXPECT_EQ(server.Run(direct).state(), v1::JOB_STATE_SUCCEEDED);
  }
  done = true;
  scrapers.clear();
  EXPECT_GT(answers, 6);
  EXPECT_EQ(others, 0);
  EXPECT_EQ(server.Status("/livez"), 200);
}

// The number is of the certificate in force.
TEST(Watching, ARefusedCertificateDoesNotCount) {
  const TempDir dir;
  const TestAuthority authority;
  CertificateRequest request;
  request.common_name = "localhost";
  request.not_before = absl::Now() - absl::Hours(48);
  request.not_after = absl::FromUnixSeconds(absl::ToUnixSeconds(absl::Now()) + 1'000'000);
  const IssuedCertificate good = authority.Issue(request);
  request.not_after = absl::Now() - absl::Hours(24);
  const IssuedCertificate expired = authority.Issue(request);
  ReplaceFile(dir.Path("cert.pem"), good.certificate);
  ReplaceFile(dir.Path("key.pem"), good.key);
  Watched server({"--workers=1", "--tls-cert=" + dir.Path("cert.pem"), "--tls-key=" + dir.Path("key.pem")});
  const auto end = [&] {
    return ParseScrape(server.Get("/metrics")).values["planish_tls_certificate_not_after_seconds"];
  };
  const double before = end();
  EXPECT_GT(before, absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch()));
  ReplaceFile(dir.Path("key.pem"), expired.key);
  ReplaceFile(dir.Path("cert.pem"), expired.certificate);
  EXPECT_THAT(server.daemon().ReadUntil("stays as it was"), HasSubstr("stays as it was"));
  EXPECT_EQ(end(), before);
}

TEST(Watching, AddressThatIsTakenIsRefused) {
  Watched server({"--workers=1"});
  Daemon bad({"--metrics-listen=nonsense"}, false);
  EXPECT_EQ(bad.Wait(), 2);
  EXPECT_THAT(bad.Output(), HasSubstr("--metrics-listen: nonsense: not HOST:PORT"));
}

// ---- traces

TEST(Traces, GoFromTheCallToTheLog) {
  Watched server({"--workers=1", "--threads=1"});
  v1::Job job;
  ASSERT_TRUE(server.Create(RequestOf(Bump(4)), &job, "solve=abort", kTraceparent).ok());
  EXPECT_EQ(job.traceparent(), kTraceparent);
  EXPECT_EQ(server.Follow(job.name()).state(), v1::JOB_STATE_FAILED);
  server.daemon().CloseSupervisor();
  server.daemon().Wait();
  std::istringstream log(server.daemon().Output());
  int about_job = 0, about_worker = 0;
  for (std::string line; std::getline(log, line);) {
    if (line.find(job.name()) == std::string::npos) continue;
    ++(line.find("worker crashed") == std::string::npos ? about_job : about_worker);
    EXPECT_THAT(line, HasSubstr(kTraceId));
  }
  EXPECT_EQ(about_worker, 3) << "a job is tried three times";
  EXPECT_GE(about_job, 7) << "QUEUED RUNNING QUEUED RUNNING QUEUED RUNNING FAILED";
}

TEST(Traces, MalformedOnesAreReplaced) {
  Watched server({"--workers=1", "--threads=1"});
  const std::regex valid("00-[0-9a-f]{32}-[0-9a-f]{16}-01");
  std::set<std::string> seen;
  for (const std::string& sent : {std::string(), kTraceparent + "0", "ff" + kTraceparent.substr(2),
                                  std::string("00-00000000000000000000000000000000-b7ad6b7169203331-01")}) {
    v1::Job job;
    ASSERT_TRUE(server.Create(RequestOf(Bump(4)), &job, "", sent).ok());
    EXPECT_TRUE(std::regex_match(job.traceparent(), valid)) << job.traceparent();
    EXPECT_THAT(job.traceparent(), ::testing::Not(HasSubstr(kTraceId)));
    seen.insert(job.traceparent());
  }
  EXPECT_EQ(seen.size(), 4U);
  grpc::ClientContext twice;
  twice.AddMetadata("traceparent", kTraceparent);
  twice.AddMetadata("traceparent", kTraceparent);
  v1::Job job;
  ASSERT_TRUE(server.stub().CreateJob(&twice, RequestOf(Bump(4)), &job).ok());
  EXPECT_THAT(job.traceparent(), ::testing::Not(HasSubstr(kTraceId))) << "which one?";
}

TEST(Labels, CallersMakeNone) {
  Watched server({"--workers=1"});
  const auto call = [&](const std::string& path) {
    grpc::GenericStub stub(server.channel());
    grpc::ClientContext context;
    grpc::CompletionQueue queue;
    const grpc::Slice nothing;
    const auto unary = stub.PrepareUnaryCall(&context, path, grpc::ByteBuffer(&nothing, 1), &queue);
    unary->StartCall();
    grpc::ByteBuffer answer;
    grpc::Status status;
    unary->Finish(&answer, &status, nullptr);
    void* tag = nullptr;
    bool ok = false;
    queue.Next(&tag, &ok);
    return status.error_code();
  };
  EXPECT_EQ(call("/planish.v1.Planish/Nothing0"), grpc::StatusCode::UNIMPLEMENTED);
  const std::ptrdiff_t before = SeriesCount(server);
  for (int i = 1; i < 300; ++i) {
    const std::string name = "Nothing" + std::to_string(i);
    for (const std::string& path : {"/planish.v1.Planish/" + name, "/planish.v1." + name + "/Call", "/" + name}) {
      EXPECT_EQ(call(path), grpc::StatusCode::UNIMPLEMENTED) << path;
    }
  }
  EXPECT_EQ(SeriesCount(server), before);
  EXPECT_THAT(server.Get("/metrics"), HasSubstr("planish_calls_total{call=\"OTHER\",code=\"UNIMPLEMENTED\"} 599"));
}

}  // namespace
}  // namespace planish
