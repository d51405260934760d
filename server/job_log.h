#pragma once

#include "planish/v1/job.pb.h"
#include "server/log/log.h"

namespace planish {

// Logs one line about a job that changed its state: names, times and sizes, but nothing about the mesh's contents.
void LogTransition(const v1::Job& job);

// The first fields of every line about a job: job, tenant and trace.
LogFields JobFields(const v1::Job& job);

}  // namespace planish
