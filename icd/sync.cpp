#include "icd/sync.h"

#include <algorithm>
#include <cstring>
#include <ctime>

#include "entrypoints.h"
#include "icd/queue.h"

namespace pumice::icd {
namespace {

QueueWorker& worker(VkDevice device) { return *from(device)->queue.worker; }
SyncHub& hub(VkDevice device) { return worker(device).hub(); }

}  // namespace

bool writeQueryResult(const QueryPool& pool, const Query& query, VkQueryResultFlags flags, std::byte* out, uint64_t bytes) {
  const bool writeValues = query.available || (flags & VK_QUERY_RESULT_PARTIAL_BIT);
  const uint64_t width = flags & VK_QUERY_RESULT_64_BIT ? 8 : 4;
  uint64_t at = 0;
  auto put = [&](uint64_t word, bool write) {
    // Results that do not fit 32 bits may wrap or saturate; saturation misleads less.
    if (width == 4) word = std::min<uint64_t>(word, 0xffffffffu);
    if (write && at + width <= bytes) std::memcpy(out + at, &word, width);
    at += width;
  };
  if (pool.type == VK_QUERY_TYPE_PIPELINE_STATISTICS) {
    for (uint32_t i = 0; i < pipeline::PipelineStatistics::Count; i++)
      if (pool.statistics >> i & 1) put(query.statistics.values[i], writeValues);
  } else {
    put(query.value, writeValues);
  }
  if (flags & VK_QUERY_RESULT_WITH_AVAILABILITY_BIT) put(query.available, true);
  return writeValues;
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateFence(VkDevice device, const VkFenceCreateInfo* info, const VkAllocationCallbacks* callbacks, VkFence* out) {
  auto* fence = from(device)->make<Fence>(callbacks);
  if (!fence) return VK_ERROR_OUT_OF_HOST_MEMORY;
  fence->signaled = info->flags & VK_FENCE_CREATE_SIGNALED_BIT;
  *out = to<VkFence>(fence);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyFence(VkDevice device, VkFence fence, const VkAllocationCallbacks* callbacks) { from(device)->destroy(callbacks, from(fence)); }

VKAPI_ATTR VkResult VKAPI_CALL vkResetFences(VkDevice device, uint32_t count, const VkFence* fences) {
  hub(device).update([&] {
    for (uint32_t i = 0; i < count; i++) from(fences[i])->signaled = false;
  });
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetFenceStatus(VkDevice device, VkFence fence) {
  if (hub(device).lost()) return VK_ERROR_DEVICE_LOST;
  return hub(device).read([&] { return from(fence)->signaled; }) ? VK_SUCCESS : VK_NOT_READY;
}

VKAPI_ATTR VkResult VKAPI_CALL vkWaitForFences(VkDevice device, uint32_t count, const VkFence* fences, VkBool32 all, uint64_t timeout) {
  auto signaled = [](VkFence f) { return from(f)->signaled; };
  auto ready = [&] { return all ? std::all_of(fences, fences + count, signaled) : std::any_of(fences, fences + count, signaled); };
  worker(device).waits(timeout, std::span(fences, count));
  return hub(device).waitOrLost(timeout, ready);
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateSemaphore(VkDevice device, const VkSemaphoreCreateInfo* info, const VkAllocationCallbacks* callbacks, VkSemaphore* out) {
  auto* semaphore = from(device)->make<Semaphore>(callbacks);
  if (!semaphore) return VK_ERROR_OUT_OF_HOST_MEMORY;
  if (auto* type = findInChain<VkSemaphoreTypeCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO)) {
    semaphore->timeline = type->semaphoreType == VK_SEMAPHORE_TYPE_TIMELINE;
    if (semaphore->timeline) semaphore->value = type->initialValue;
  }
  auto* exported = findInChain<VkExportSemaphoreCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_EXPORT_SEMAPHORE_CREATE_INFO);
  if (exported && exported->handleTypes && !semaphore->timeline && !semaphore->permanent.make()) {
    from(device)->destroy(callbacks, semaphore);
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  *out = to<VkSemaphore>(semaphore);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroySemaphore(VkDevice device, VkSemaphore s, const VkAllocationCallbacks* callbacks) { from(device)->destroy(callbacks, from(s)); }

VKAPI_ATTR VkResult VKAPI_CALL vkGetSemaphoreCounterValue(VkDevice device, VkSemaphore s, uint64_t* value) {
  if (hub(device).lost()) return VK_ERROR_DEVICE_LOST;
  *value = hub(device).read([&] { return from(s)->value; });
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkWaitSemaphores(VkDevice device, const VkSemaphoreWaitInfo* info, uint64_t timeout) {
  bool any = info->flags & VK_SEMAPHORE_WAIT_ANY_BIT;
  auto ready = [&] {
    for (uint32_t i = 0; i < info->semaphoreCount; i++)
      if ((from(info->pSemaphores[i])->value >= info->pValues[i]) == any) return any;
    return !any;
  };
  worker(device).waits(timeout, std::span(info->pSemaphores, info->semaphoreCount));
  return hub(device).waitOrLost(timeout, ready);
}

VKAPI_ATTR VkResult VKAPI_CALL vkSignalSemaphore(VkDevice device, const VkSemaphoreSignalInfo* info) {
  hub(device).update([&] { from(info->semaphore)->value = info->value; });
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateEvent(VkDevice device, const VkEventCreateInfo*, const VkAllocationCallbacks* callbacks, VkEvent* out) {
  auto* event = from(device)->make<Event>(callbacks);
  if (!event) return VK_ERROR_OUT_OF_HOST_MEMORY;
  *out = to<VkEvent>(event);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyEvent(VkDevice device, VkEvent e, const VkAllocationCallbacks* callbacks) { from(device)->destroy(callbacks, from(e)); }

VKAPI_ATTR VkResult VKAPI_CALL vkGetEventStatus(VkDevice device, VkEvent e) {
  if (hub(device).lost()) return VK_ERROR_DEVICE_LOST;
  return hub(device).read([&] { return from(e)->set; }) ? VK_EVENT_SET : VK_EVENT_RESET;
}

VKAPI_ATTR VkResult VKAPI_CALL vkSetEvent(VkDevice device, VkEvent e) {
  hub(device).update([&] { from(e)->set = true; });
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkResetEvent(VkDevice device, VkEvent e) {
  hub(device).update([&] { from(e)->set = false; });
  return VK_SUCCESS;
}

uint64_t clockNanoseconds(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return uint64_t(t.tv_sec) * 1'000'000'000 + uint64_t(t.tv_nsec);
}

constexpr VkTimeDomainEXT kTimeDomains[] = {VK_TIME_DOMAIN_DEVICE_EXT, VK_TIME_DOMAIN_CLOCK_MONOTONIC_EXT, VK_TIME_DOMAIN_CLOCK_MONOTONIC_RAW_EXT};

VKAPI_ATTR VkResult VKAPI_CALL vkGetPhysicalDeviceCalibrateableTimeDomainsEXT(VkPhysicalDevice, uint32_t* count, VkTimeDomainEXT* out) {
  return enumerate(uint32_t(std::size(kTimeDomains)), count, out, [](uint32_t i, VkTimeDomainEXT& d) { d = kTimeDomains[i]; });
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetCalibratedTimestampsEXT(VkDevice, uint32_t count, const VkCalibratedTimestampInfoEXT* infos, uint64_t* out, uint64_t* deviation) {
  uint64_t begin = clockNanoseconds();
  for (uint32_t i = 0; i < count; i++) out[i] = clockNanoseconds(infos[i].timeDomain == VK_TIME_DOMAIN_CLOCK_MONOTONIC_RAW_EXT ? CLOCK_MONOTONIC_RAW : CLOCK_MONOTONIC);
  *deviation = clockNanoseconds() - begin + 1;
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateQueryPool(VkDevice device, const VkQueryPoolCreateInfo* info, const VkAllocationCallbacks* callbacks, VkQueryPool* out) {
  if (info->queryType > VK_QUERY_TYPE_TIMESTAMP) return VK_ERROR_FEATURE_NOT_PRESENT;
  auto* pool = from(device)->make<QueryPool>(callbacks, from(device)->allocatorFor(callbacks));
  if (!pool) return VK_ERROR_OUT_OF_HOST_MEMORY;
  pool->type = info->queryType;
  pool->statistics = info->pipelineStatistics;
  try {
    pool->queries.resize(info->queryCount);
  } catch (const std::bad_alloc&) {
    from(device)->destroy(callbacks, pool);
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  *out = to<VkQueryPool>(pool);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyQueryPool(VkDevice device, VkQueryPool pool, const VkAllocationCallbacks* callbacks) { from(device)->destroy(callbacks, from(pool)); }

VKAPI_ATTR void VKAPI_CALL vkResetQueryPool(VkDevice device, VkQueryPool pool, uint32_t first, uint32_t count) {
  hub(device).update([&] { std::fill_n(from(pool)->queries.begin() + first, count, Query{}); });
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetQueryPoolResults(VkDevice device, VkQueryPool handle, uint32_t first, uint32_t count, size_t bytes, void* data,
                                                     VkDeviceSize stride, VkQueryResultFlags flags) {
  auto* out = static_cast<std::byte*>(data);
  VkResult result = VK_SUCCESS;
  for (uint32_t i = 0; i < count; i++) {
    const Query& query = from(handle)->queries[first + i];
    if (flags & VK_QUERY_RESULT_WAIT_BIT && hub(device).waitOrLost(~0ull, [&] { return query.available; }) < 0) return VK_ERROR_DEVICE_LOST;
    uint64_t offset = i * stride;
    hub(device).read([&] {
      if (!writeQueryResult(*from(handle), query, flags, out + offset, offset < bytes ? bytes - offset : 0)) result = VK_NOT_READY;
      return 0;
    });
  }
  return result;
}

}  // namespace pumice::icd
