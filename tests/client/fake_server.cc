#include "tests/client/fake_server.h"

#include <grpcpp/grpcpp.h>

#include "core/base/sha256.h"
#include "google/rpc/error_details.pb.h"
#include "gtest/gtest.h"
#include "planish/v1/planish.grpc.pb.h"

namespace planish::testing {
namespace {

grpc::Status ToGrpc(const google::rpc::Status& status) {
  if (status.code() == 0) return grpc::Status::OK;
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()), status.message(),
                      status.details_size() > 0 ? status.SerializeAsString() : "");
}

const grpc::Status kUnimplemented(grpc::StatusCode::UNIMPLEMENTED, "the test has no script for this");

template <typename Response>
class Writer : public FakeStream {
 public:
  Writer(grpc::ServerContext* context, grpc::ServerWriter<Response>* writer) : context_(context), writer_(writer) {}
  void Send(const v1::JobEvent& event) override {
    Response response;
    *response.mutable_event() = event;
    writer_->Write(response);
  }
  void SendUv(std::int64_t offset, const std::string& data) override {
    Response response;
    response.mutable_uv()->set_offset(offset);
    response.mutable_uv()->set_data(data);
    writer_->Write(response);
  }
  bool IsCancelled() const override { return context_->IsCancelled(); }

 private:
  grpc::ServerContext* context_;
  grpc::ServerWriter<Response>* writer_;
};

class UploadReader : public FakeUpload {
 public:
  explicit UploadReader(grpc::ServerReader<v1::WriteUploadRequest>* reader) : reader_(reader) {}
  bool Next(v1::WriteUploadRequest& request) override { return reader_->Read(&request); }

 private:
  grpc::ServerReader<v1::WriteUploadRequest>* const reader_;
};

}  // namespace

class FakeServer::Service : public v1::Planish::Service {
 public:
  Service(FakeServer* fake, int wanted_port) : fake_(fake) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:" + std::to_string(wanted_port), grpc::InsecureServerCredentials(), &port);
    builder.SetMaxReceiveMessageSize(-1);
    builder.RegisterService(this);
    server = builder.BuildAndStart();
  }

  grpc::Status Unwrap(grpc::ServerContext* context, const v1::UnwrapRequest* request,
                      grpc::ServerWriter<v1::UnwrapResponse>* writer) override {
    if (!fake_->on_unwrap) return kUnimplemented;
    Writer<v1::UnwrapResponse> stream(context, writer);
    return ToGrpc(fake_->on_unwrap(*request, stream));
  }
  grpc::Status WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                        grpc::ServerWriter<v1::WatchJobResponse>* writer) override {
    if (!fake_->on_watch) return kUnimplemented;
    Writer<v1::WatchJobResponse> stream(context, writer);
    return ToGrpc(fake_->on_watch(*request, stream));
  }
  grpc::Status CreateJob(grpc::ServerContext*, const v1::CreateJobRequest* request, v1::Job* job) override {
    return fake_->on_create ? ToGrpc(fake_->on_create(*request, *job)) : kUnimplemented;
  }
  grpc::Status ListJobs(grpc::ServerContext*, const v1::ListJobsRequest* request,
                        v1::ListJobsResponse* response) override {
    return fake_->on_list ? ToGrpc(fake_->on_list(*request, *response)) : kUnimplemented;
  }
  grpc::Status GetJob(grpc::ServerContext*, const v1::GetJobRequest* request, v1::Job* job) override {
    return fake_->on_job ? ToGrpc(fake_->on_job("Get", request->name(), *job)) : kUnimplemented;
  }
  grpc::Status BatchCreateJobs(grpc::ServerContext*, const v1::BatchCreateJobsRequest* request,
                               v1::BatchCreateJobsResponse* response) override {
    return fake_->on_batch ? ToGrpc(fake_->on_batch(*request, *response)) : kUnimplemented;
  }
  grpc::Status FindMissingMeshes(grpc::ServerContext*, const v1::FindMissingMeshesRequest* request,
                                 v1::FindMissingMeshesResponse* response) override {
    return fake_->on_find_missing ? ToGrpc(fake_->on_find_missing(*request, *response)) : kUnimplemented;
  }
  grpc::Status WaitJob(grpc::ServerContext*, const v1::WaitJobRequest* request, v1::Job* job) override {
    return fake_->on_wait ? ToGrpc(fake_->on_wait(*request, *job)) : kUnimplemented;
  }
  grpc::Status ReadResult(grpc::ServerContext*, const v1::ReadResultRequest* request,
                          v1::ReadResultResponse* response) override {
    return fake_->on_read ? ToGrpc(fake_->on_read(*request, *response)) : kUnimplemented;
  }
  grpc::Status StopJob(grpc::ServerContext*, const v1::StopJobRequest* request, v1::Job* job) override {
    return fake_->on_job ? ToGrpc(fake_->on_job("Stop", request->name(), *job)) : kUnimplemented;
  }
  grpc::Status EstimateJob(grpc::ServerContext*, const v1::EstimateJobRequest* request,
                           v1::JobEstimate* estimate) override {
    return fake_->on_estimate ? ToGrpc(fake_->on_estimate(*request, *estimate)) : kUnimplemented;
  }
  grpc::Status GetCapabilities(grpc::ServerContext*, const v1::GetCapabilitiesRequest*,
                               v1::Capabilities* capabilities) override {
    return fake_->on_capabilities ? ToGrpc(fake_->on_capabilities(*capabilities)) : kUnimplemented;
  }
  grpc::Status CreateUpload(grpc::ServerContext*, const v1::CreateUploadRequest* request, v1::Upload* upload) override {
    return fake_->on_create_upload ? ToGrpc(fake_->on_create_upload(*request, *upload)) : kUnimplemented;
  }
  grpc::Status GetUpload(grpc::ServerContext*, const v1::GetUploadRequest* request, v1::Upload* upload) override {
    return fake_->on_get_upload ? ToGrpc(fake_->on_get_upload(request->name(), *upload)) : kUnimplemented;
  }
  grpc::Status WriteUpload(grpc::ServerContext*, grpc::ServerReader<v1::WriteUploadRequest>* reader,
                           v1::Upload* upload) override {
    if (!fake_->on_write_upload) return kUnimplemented;
    UploadReader messages(reader);
    return ToGrpc(fake_->on_write_upload(messages, *upload));
  }
  grpc::Status CancelJob(grpc::ServerContext*, const v1::CancelJobRequest* request, v1::Job* job) override {
    return fake_->on_job ? ToGrpc(fake_->on_job("Cancel", request->name(), *job)) : kUnimplemented;
  }
  grpc::Status DeleteJob(grpc::ServerContext*, const v1::DeleteJobRequest* request, google::protobuf::Empty*) override {
    v1::Job job;
    return fake_->on_job ? ToGrpc(fake_->on_job("Delete", request->name(), job)) : kUnimplemented;
  }

  int port = 0;
  std::unique_ptr<grpc::Server> server;

 private:
  FakeServer* const fake_;
};

FakeServer::FakeServer(int port)
    : service_(std::make_unique<Service>(this, port)), target_("127.0.0.1:" + std::to_string(service_->port)) {}

int FakeServer::port() const {
  return service_->port;
}

void FakeServer::Stop() {
  service_->server->Shutdown(std::chrono::system_clock::now());
  service_->server->Wait();
}

FakeServer::~FakeServer() {
  Stop();
}

google::rpc::Status MakeStatus(int code, const std::string& message, const std::string& reason,
                               const std::map<std::string, std::string>& metadata, double retry_seconds) {
  google::rpc::Status status;
  status.set_code(code);
  status.set_message(message);
  if (!reason.empty()) {
    google::rpc::ErrorInfo info;
    info.set_reason(reason);
    info.set_domain("planish");
    for (const auto& [key, value] : metadata) (*info.mutable_metadata())[key] = value;
    status.add_details()->PackFrom(info);
  }
  if (retry_seconds > 0) {
    google::rpc::RetryInfo retry;
    retry.mutable_retry_delay()->set_nanos(static_cast<int>(1e9 * retry_seconds));
    status.add_details()->PackFrom(retry);
  }
  return status;
}

Error ErrorOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error;
  }
  ADD_FAILURE() << "nothing was thrown";
  return Error(ErrorCode::kUnknown, "", "");
}

v1::JobEvent StateEvent(std::int64_t sequence, v1::JobState state) {
  v1::JobEvent event;
  event.set_sequence(sequence);
  event.mutable_job()->set_name("jobs/1");
  event.mutable_job()->set_state(state);
  return event;
}

v1::JobEvent ProgressEvent(std::int64_t sequence, int newton_iteration, double residual) {
  v1::JobEvent event;
  event.set_sequence(sequence);
  v1::Progress& progress = *event.mutable_progress();
  progress.set_stage(v1::STAGE_SOLVE);
  progress.set_newton_iteration(newton_iteration);
  progress.mutable_residual()->set_vertex(residual);
  progress.set_tolerance(1e-9);
  return event;
}

v1::JobEvent SuccessEvent(std::int64_t sequence, const std::string& draco, const std::string& uv_bytes,
                          v1::Precision precision) {
  v1::JobEvent event = StateEvent(sequence, v1::JOB_STATE_SUCCEEDED);
  v1::UvDescription& uv = *event.mutable_job()->mutable_uv();
  uv.set_precision(precision);
  uv.set_corner_count(static_cast<std::int64_t>(uv_bytes.size()) / (precision == v1::PRECISION_DOUBLE ? 16 : 8));
  uv.set_total_bytes(static_cast<std::int64_t>(uv_bytes.size()));
  uv.set_mesh_sha256(Sha256(draco));
  uv.set_uv_sha256(Sha256(uv_bytes));
  v1::Report& report = *event.mutable_job()->mutable_report();
  report.mutable_input()->set_triangles(uv.corner_count() / 3);
  v1::ChartReport& chart = *report.add_charts();
  chart.set_method("abf");
  chart.set_solver(v1::SOLVER_DIRECT);
  chart.set_converged(true);
  report.mutable_times()->mutable_solve()->set_nanos(250'000'000);
  return event;
}

}  // namespace planish::testing
