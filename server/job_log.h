#pragma once

#include "planish/v1/job.pb.h"

namespace planish {

// Writes one line about a job that changed its state: names, times and sizes, nothing of the mesh.
void LogTransition(const v1::Job& job);

}  // namespace planish
