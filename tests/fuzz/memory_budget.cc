#include "tests/fuzz/memory_budget.h"

#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <limits>
#include <new>

namespace planish::fuzz {
namespace {

constexpr std::int64_t kNoLimit = std::numeric_limits<std::int64_t>::max();

std::atomic<std::int64_t> held = 0;
std::atomic<std::int64_t> limit = kNoLimit;

void* Allocate(std::size_t size) noexcept {
  if (static_cast<std::int64_t>(size) > limit - held) return nullptr;
  void* const block = std::malloc(size == 0 ? 1 : size);
  if (block != nullptr) held += static_cast<std::int64_t>(malloc_usable_size(block));
  return block;
}

void* AllocateOrThrow(std::size_t size) {
  void* const block = Allocate(size);
  if (block == nullptr) throw std::bad_alloc();
  return block;
}

void Free(void* block) noexcept {
  if (block == nullptr) return;
  held -= static_cast<std::int64_t>(malloc_usable_size(block));
  std::free(block);
}

}  // namespace

MemoryBudget::MemoryBudget(std::int64_t bytes) {
  limit = held + bytes;
}

MemoryBudget::~MemoryBudget() {
  limit = kNoLimit;
}

}  // namespace planish::fuzz

using planish::fuzz::Allocate;
using planish::fuzz::AllocateOrThrow;
using planish::fuzz::Free;

void* operator new(std::size_t size) {
  return AllocateOrThrow(size);
}
void* operator new[](std::size_t size) {
  return AllocateOrThrow(size);
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return Allocate(size);
}
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
  return Allocate(size);
}
void operator delete(void* block) noexcept {
  Free(block);
}
void operator delete[](void* block) noexcept {
  Free(block);
}
void operator delete(void* block, std::size_t) noexcept {
  Free(block);
}
void operator delete[](void* block, std::size_t) noexcept {
  Free(block);
}
void operator delete(void* block, const std::nothrow_t&) noexcept {
  Free(block);
}
void operator delete[](void* block, const std::nothrow_t&) noexcept {
  Free(block);
}
