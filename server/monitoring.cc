#include "server/monitoring.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace planish {
namespace {

using Clock = std::chrono::steady_clock;
using Obstacle = Readiness::Obstacle;

// Longest time without a beat or a round of upkeep. Both run ten times a second, but a slow disk may delay upkeep.
constexpr std::chrono::seconds kBeatLimit(30);
constexpr absl::Duration kAnswerLimit = absl::Seconds(3);
constexpr std::chrono::seconds kProbeInterval(2);
// How long the store may take to answer before the server counts as not ready, and how long a scrape waits for its
// figures.
constexpr std::chrono::seconds kStoreLimit(5);
constexpr std::chrono::seconds kScrapePatience(1);

constexpr char kTextFormat[] = "text/plain; version=0.0.4; charset=utf-8";

HttpAnswer Unavailable(const std::string& why) {
  return {503, why + "\n"};
}

std::int64_t SecondsOf(Clock::duration duration) {
  return std::chrono::duration_cast<std::chrono::seconds>(duration).count();
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
  last_beat_ = last_upkeep_ = Clock::now();
  {
    const std::unique_lock lock(mutex_);
    server_ = server;
    if (server.ask_store != nullptr) probe_ = std::make_unique<PatientQuestion<absl::Status>>(server.ask_store);
    figures_ = std::make_unique<PatientQuestion<StoreFigures>>(
        [jobs = server.jobs, uploads = server.uploads, last = ManagerStats()]() mutable {
          ManagerStats stats = jobs->Stats();
          if (stats.store_answered) last = stats;
          last.store_answered = stats.store_answered;
          return StoreFigures{last, uploads->Gauges()};
        });
  }
  readiness_.Set(Obstacle::kStarting, "");
  TellReadiness();
}

void Monitoring::Beat() {
  const Clock::time_point now = Clock::now();
  last_beat_ = now;
  bool draining = false;
  std::string store;
  {
    const std::shared_lock lock(mutex_);
    if (!server_.has_value()) return;
    draining = server_->jobs->IsDraining();
    store = StoreObstacle(now);
  }
  readiness_.Set(Obstacle::kDraining, draining ? "the server is draining and takes no new jobs" : "");
  {
    const std::lock_guard lock(start_mutex_);
    readiness_.Set(Obstacle::kWorkers, metrics_.workers_ready() == 0 ? start_error_ : "");
  }
  readiness_.Set(Obstacle::kStore, std::move(store));
  const Clock::duration silence = now - last_upkeep_.load();
  readiness_.Set(Obstacle::kUpkeep,
                 silence > kBeatLimit ? absl::StrCat("upkeep has not come round for ", SecondsOf(silence), " s") : "");
  TellReadiness();
}

std::string Monitoring::StoreObstacle(Clock::time_point now) {
  if (probe_ == nullptr) return "";
  if (now >= next_probe_) {
    next_probe_ = now + kProbeInterval;
    probe_->Ask();
  }
  const Clock::duration silence = probe_->Silence();
  if (silence > kStoreLimit) return absl::StrCat("the store has not answered for ", SecondsOf(silence), " s");
  return std::string(probe_->Newest().value_or(absl::OkStatus()).message());
}

void Monitoring::SetEnding() {
  ending_ = true;
  readiness_.Set(Obstacle::kEnding, "the server is shutting down and takes no new jobs");
  TellReadiness();
}

void Monitoring::Detach() {
  std::unique_ptr<PatientQuestion<absl::Status>> probe;  // destroyed without the lock
  std::unique_ptr<PatientQuestion<StoreFigures>> figures;
  const std::unique_lock lock(mutex_);
  server_.reset();
  probe.swap(probe_);
  figures.swap(figures_);
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

// ---- HTTP answers

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
    std::optional<StoreFigures> figures;
    gauges.store_answers = figures_->AskAndWait(kScrapePatience, &figures) && figures->jobs.store_answered;
    if (figures.has_value()) {
      gauges.jobs = std::move(figures->jobs);
      gauges.uploads = figures->uploads;
    }
    gauges.jobs.draining = server_->jobs->IsDraining();
    gauges.workers = server_->workers;
    gauges.memory_limit_bytes = server_->memory_limit_bytes;
    gauges.store_bytes = server_->blobs->bytes();
    gauges.store_limit_bytes = server_->store_limit_bytes;
    gauges.uploads_limit_bytes = server_->uploads_limit_bytes;
    gauges.uv_sent_bytes = server_->streams->uv_bytes();
    gauges.streams = server_->streams->count();
    if (server_->clock_skew != nullptr) gauges.clock_skew = server_->clock_skew();
    if (server_->certificate_end != nullptr) gauges.certificate_end = server_->certificate_end();
  }
  gauges.ready = readiness_.WhyNot().empty();
  return {200, metrics_.Text(gauges), kTextFormat};
}

HttpAnswer Monitoring::Live() const {
  const std::shared_lock lock(mutex_);
  // Live also before Attach() and after Detach(): opening the stores may take long, and so may the shutdown.
  if (!server_.has_value()) return {200, "live\n"};
  const Clock::duration silence = Clock::now() - last_beat_.load();
  if (silence > kBeatLimit) return Unavailable(absl::StrCat("no thread has run for ", SecondsOf(silence), " s"));
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
