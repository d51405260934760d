#include "server/jobs/worker_pool.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace planish {

WorkerPool::WorkerPool(JobManager* manager, WorkerFactory factory, int workers)
    : manager_(manager), factory_(std::move(factory)) {
  for (int i = 0; i < workers; ++i) {
    threads_.emplace_back([this] {
      while (std::optional<JobAssignment> assignment = manager_->TakeNext()) Serve(*std::move(assignment));
    });
  }
}

WorkerPool::~WorkerPool() {
  for (std::thread& thread : threads_) thread.join();
}

void WorkerPool::Serve(JobAssignment assignment) {
  const std::string& name = assignment.name;
  absl::StatusOr<std::shared_ptr<WorkerLink>> link = factory_();
  if (!link.ok()) {
    manager_->ReportLost(name, "no worker could be started: " + std::string(link.status().message()));
    return;
  }
  worker::v1::ToWorker request;
  *request.mutable_request() = std::move(assignment.request);
  (*link)->Send(std::move(request));
  manager_->SetLink(name, *link);

  while (std::optional<worker::v1::FromWorker> message = (*link)->Receive()) {
    if (message->has_event()) {
      manager_->ReportProgress(name, std::move(*message->mutable_event()->mutable_progress()));
    } else if (message->has_result()) {
      manager_->ReportResult(name, std::move(*message->mutable_result()));
      return;
    }
  }
  manager_->ReportLost(name, "the worker ended without a result");
}

}  // namespace planish
