#pragma once

#include "planish/v1/job.pb.h"
#include "server/log/log.h"

namespace planish {

// Writes one line about a job that changed its state: names, times and sizes, nothing of the mesh.
void LogTransition(const v1::Job& job);

// Which job, of whom, in which trace: what begins the fields of any line about a job.
LogFields JobFields(const v1::Job& job);

}  // namespace planish
