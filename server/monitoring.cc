#include "server/monitoring.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "server/metrics/certificate.h"
#include "server/metrics/store_probe.h"

namespace planish {
namespace {

using Clock = std::chrono::steady_clock;
using Obstacle = Readiness::Obstacle;

// Upkeep comes round ten times a second; a store on a slow disk may hold it up.
constexpr std::chrono::seconds kBeatLimit(30);
constexpr absl::Duration kAnswerLimit = absl::Seconds(3);
constexpr std::chrono::seconds kProbeInterval(2);

constexpr char kTextFormat[] = "text/plain; version=0.0.4; charset=utf-8";

HttpAnswer Unavailable(const std::string& why) {
  return {503, why + "\n"};
}

}  // namespace

absl::Status Monitoring::Listen(const HttpEndpointOptions& options) {
  absl::StatusOr<std::unique_ptr<HttpEndpoint>> endpoint =
      HttpEndpoint::Start(options, [this](const std::string& path) { return Answer(path); });
  if (!endpoint.ok()) return endpoint.status();
  endpoint_ = *std::move(endpoint);
  return absl::OkStatus();
}

std::optional<std::string> Monitoring::address() const {
  if (endpoint_ == nullptr) return std::nullopt;
  return endpoint_->address();
}

// ---- hooks

void Monitoring::Hook(JobManagerOptions* options) {
  options->observer = &metrics_;
  options->on_transition = [this, before = std::move(options->on_transition)](const v1::Job& job) {
    metrics_.OnTransition(job);
    if (before) before(job);
  };
  options->on_store_error = [this, before = std::move(options->on_store_error)](const absl::Status& status) {
    metrics_.OnStoreError();
    if (before) before(status);
  };
}

void Monitoring::Hook(WorkerPoolOptions* options) {
  options->on_worker_ready = [this, before = std::move(options->on_worker_ready)](const worker::v1::WorkerIdle& idle) {
    metrics_.OnWorkerStarted();
    SetStartError("");
    if (before) before(idle);
  };
  options->on_worker_end = [this, before = std::move(options->on_worker_end)](const WorkerEnd& end) {
    metrics_.OnWorkerEnded(end.cause);
    if (before) before(end);
  };
  options->on_start_failed = [this, before = std::move(options->on_start_failed)](const absl::Status& status,
                                                                                  absl::Duration retry) {
    metrics_.OnWorkerStartFailed();
    SetStartError(absl::StrCat("no worker can be started: ", status.message()));
    if (before) before(status, retry);
  };
}

void Monitoring::SetStartError(std::string error) {
  const std::lock_guard lock(start_mutex_);
  start_error_ = std::move(error);
}

CallListener Monitoring::Calls() {
  return [this](const EndedCall& call) {
    metrics_.OnCallEnded(call.call, call.code, call.reason, call.duration, {call.streams, call.submits});
  };
}

// ---- the server's life

void Monitoring::Attach(const WatchedServer& server) {
  last_beat_ = Clock::now();
  {
    const std::unique_lock lock(mutex_);
    server_ = server;
  }
  readiness_.Set(Obstacle::kStarting, "");
  TellReadiness();
}

void Monitoring::Beat() {
  const Clock::time_point now = Clock::now();
  last_beat_ = now;
  bool draining = false;
  std::string data_dir;
  {
    const std::shared_lock lock(mutex_);
    if (!server_.has_value()) return;
    draining = server_->jobs->IsDraining();
    data_dir = server_->data_dir;
  }
  readiness_.Set(Obstacle::kDraining, draining ? "the server is draining and takes no new jobs" : "");
  {
    const std::lock_guard lock(start_mutex_);
    readiness_.Set(Obstacle::kWorkers, metrics_.workers_ready() == 0 ? start_error_ : "");
  }
  if (!data_dir.empty() && now >= next_probe_) {
    next_probe_ = now + kProbeInterval;
    readiness_.Set(Obstacle::kStore, std::string(TryToWrite(data_dir).message()));
  }
  TellReadiness();
}

void Monitoring::SetEnding() {
  ending_ = true;
  readiness_.Set(Obstacle::kEnding, "the server is shutting down and takes no new jobs");
  TellReadiness();
}

void Monitoring::Detach() {
  const std::unique_lock lock(mutex_);
  server_.reset();
}

void Monitoring::TellReadiness() {
  const std::lock_guard telling(telling_);
  const std::string why_not = readiness_.WhyNot();
  const bool ready = why_not.empty();
  if (ready == told_ready_) return;
  const std::shared_lock lock(mutex_);
  if (!server_.has_value()) return;
  if (server_->rpc != nullptr) server_->rpc->SetReady(ready);
  told_ready_ = ready;
  if (on_readiness_) on_readiness_(why_not);
}

// ---- what is asked over HTTP

HttpAnswer Monitoring::Answer(const std::string& path) const {
  if (path == "/metrics") return Metrics();
  if (path == "/livez") return Live();
  if (path == "/readyz") return Ready();
  return {404, "there is /metrics, /livez and /readyz\n"};
}

HttpAnswer Monitoring::Metrics() const {
  ServerGauges gauges;
  {
    const std::shared_lock lock(mutex_);
    if (!server_.has_value()) return Unavailable(ending_ ? "the server is ending" : "the server is starting");
    gauges.jobs = server_->jobs->Stats();
    gauges.uploads = server_->uploads->Gauges();
    gauges.workers = server_->workers;
    gauges.memory_limit_bytes = server_->memory_limit_bytes;
    gauges.store_bytes = server_->blobs->bytes();
    gauges.store_limit_bytes = server_->store_limit_bytes;
    gauges.uploads_limit_bytes = server_->uploads_limit_bytes;
    gauges.uv_sent_bytes = server_->streams->uv_bytes();
    gauges.streams = server_->streams->count();
    if (server_->clock_skew != nullptr) gauges.clock_skew = server_->clock_skew();
    if (!server_->certificate_file.empty()) gauges.certificate_end = CertificateFileEnd(server_->certificate_file);
  }
  gauges.ready = readiness_.WhyNot().empty();
  return {200, metrics_.Text(gauges), kTextFormat};
}

HttpAnswer Monitoring::Live() const {
  const std::shared_lock lock(mutex_);
  // Opening the stores may take long, and so may the last moments.
  if (!server_.has_value()) return {200, "live\n"};
  const auto silence = std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - last_beat_.load());
  if (silence > kBeatLimit) return Unavailable(absl::StrCat("upkeep has not come round for ", silence.count(), " s"));
  if (server_->rpc != nullptr && !server_->rpc->Answers(kAnswerLimit)) {
    return Unavailable(absl::StrCat("the gRPC server does not answer within ", absl::FormatDuration(kAnswerLimit)));
  }
  return {200, "live\n"};
}

HttpAnswer Monitoring::Ready() const {
  const std::string why_not = readiness_.WhyNot();
  return why_not.empty() ? HttpAnswer{200, "ready\n"} : Unavailable(why_not);
}

}  // namespace planish
