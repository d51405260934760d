// What a computation may use (a team of threads) and what may end it early (cancel and stop requests). Every stage gets
// an Execution.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/base/interrupter.h"
#include "core/base/thread_team.h"

namespace planish {

// After a cancellation, loops skip the remaining chunks: check IsCancelled() before using their results. After a stop
// request, loops still complete and results are valid; only searches for better results end.
struct Execution {
  ThreadTeam* team = nullptr;           // null: the calling thread alone
  const Interrupter* cancel = nullptr;  // null: cannot be cancelled
  const Interrupter* stop = nullptr;    // null: cannot be stopped
  // Called with the completed fraction of the current stage, on the thread that runs it; may be null.
  const std::function<void(double)>* progress = nullptr;
  double progress_begin = 0, progress_end = 1;  // the stage's fractions for Report(0) and Report(1)

  // Iterations of a chunk, few enough that a cancellation is noticed soon.
  static constexpr std::int64_t kChunk = ThreadTeam::kChunk;
  // For loops without chunks: the steps between two calls of IsCancelled(). A power of two.
  static constexpr std::int64_t kStride = 16384;

  bool IsCancelled() const { return IsInterrupted(cancel); }
  bool IsStopRequested() const { return IsInterrupted(stop); }
  // Reports that `fraction` of this part of the stage is done, in [0, 1]. Too slow for every step of a loop.
  void Report(double fraction) const {
    if (progress != nullptr) (*progress)(progress_begin + fraction * (progress_end - progress_begin));
  }
  // The Execution for a part of this stage: its Report(0) and Report(1) are Report(begin) and Report(end) of this one.
  Execution Part(double begin, double end) const {
    Execution part = *this;
    const double whole = progress_end - progress_begin;
    part.progress_begin = progress_begin + begin * whole;
    part.progress_end = progress_begin + end * whole;
    return part;
  }
  // An Execution with the same requests, but without the team and without progress.
  Execution ForOneThread() const { return {nullptr, cancel, stop}; }
  ThreadTeam& Team() const { return team != nullptr ? *team : Alone(); }
  // IsCancelled(), checked once in kStride steps.
  bool IsCancelledAt(std::int64_t step) const { return step % kStride == 0 && IsCancelled(); }

  // Calls body(begin, end) for every chunk of [0, n) that is not skipped, as ThreadTeam::For does.
  template <typename Body>
  void For(std::int64_t n, const Body& body, std::int64_t chunk = kChunk) const {
    Team().For(n, chunk, [&](std::int64_t begin, std::int64_t end) {
      if (!IsCancelled()) body(begin, end);
    });
  }

  // Calls each(i) for every i of [0, n). The indices of a chunk run in order on one thread.
  template <typename Each>
  void ForEach(std::int64_t n, const Each& each) const {
    For(n, [&](std::int64_t begin, std::int64_t end) {
      for (std::int64_t i = begin; i < end; ++i) each(i);
    });
  }

  // The results of body(begin, end) for every chunk, in order, so that they do not depend on the number of threads.
  // Skipped chunks give Result().
  template <typename Result, typename Body>
  std::vector<Result> Collect(std::int64_t n, const Body& body) const {
    return Team().Collect<Result>(
        n, kChunk, [&](std::int64_t begin, std::int64_t end) { return IsCancelled() ? Result() : body(begin, end); });
  }

  // The sum of what each(i, &sum) adds for every i in [0, n). Each chunk has a sum of its own; Sum::Add() adds these in
  // order.
  template <typename Sum, typename Each>
  Sum SumUp(std::int64_t n, const Each& each) const {
    Sum sum;
    for (const Sum& part : Collect<Sum>(n, [&](std::int64_t begin, std::int64_t end) {
           Sum chunk;
           for (std::int64_t i = begin; i < end; ++i) each(i, &chunk);
           return chunk;
         })) {
      sum.Add(part);
    }
    return sum;
  }

  // The number of i in [0, n) that fulfil `predicate`.
  template <typename Predicate>
  std::int64_t Count(std::int64_t n, const Predicate& predicate) const {
    struct Total {
      std::int64_t count = 0;
      void Add(const Total& other) { count += other.count; }
    };
    return SumUp<Total>(n, [&](std::int64_t i, Total* total) { total->count += predicate(i) ? 1 : 0; }).count;
  }
};

}  // namespace planish
