// Blocking readers of a job's events.
#pragma once

#include <cstdint>
#include <vector>

#include "server/jobs/event_log.h"

namespace planish {

// Waits until the job ends; all its events.
std::vector<v1::JobEvent> Follow(const JobEventLog& log);

// Waits for the event with `sequence`, or a later one, or the end.
void WaitForEvent(const JobEventLog& log, std::int64_t sequence);

}  // namespace planish
