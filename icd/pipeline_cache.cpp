#include "icd/pipeline_cache.h"

#include <link.h>

#include <algorithm>
#include <cstring>

#include "base/hash.h"
#include "entrypoints.h"
#include "icd/properties.h"
#include "spirv_interp/frontend/shader_bytes.h"
#include "spirv_interp/ir/checks.h"

namespace pumice::icd {
namespace {

enum class Content : uint32_t { Shader, Routines };
struct EntryHeader {
  uint64_t key[2];
  uint64_t checksum;
  uint32_t size;
  Content content;
};
constexpr size_t kEntryHeader = sizeof(EntryHeader);
static_assert(kEntryHeader == 32);

void put(std::byte*& to, const void* from, size_t size) {
  std::memcpy(to, from, size);
  to += size;
}

uint64_t checksumOf(std::span<const std::byte> bytes) { return base::hashBytes(bytes.data(), bytes.size(), 0x70756d69); }

// The linker's note of the object that holds this code.
int findBuildId(dl_phdr_info* info, size_t, void* out) {
  const auto here = reinterpret_cast<uintptr_t>(&buildUuid);
  bool ours = false;
  for (int i = 0; i < info->dlpi_phnum; i++) {
    const auto& p = info->dlpi_phdr[i];
    ours |= p.p_type == PT_LOAD && here - (info->dlpi_addr + p.p_vaddr) < p.p_memsz;
  }
  if (!ours) return 0;
  for (int i = 0; i < info->dlpi_phnum; i++) {
    const auto& p = info->dlpi_phdr[i];
    if (p.p_type != PT_NOTE) continue;
    const auto* at = reinterpret_cast<const std::byte*>(info->dlpi_addr + p.p_vaddr);
    for (size_t left = p.p_memsz; left >= sizeof(ElfW(Nhdr));) {
      ElfW(Nhdr) note;
      std::memcpy(&note, at, sizeof note);
      const size_t name = (note.n_namesz + 3) & ~3u, content = (note.n_descsz + 3) & ~3u, whole = sizeof note + name + content;
      if (whole > left) break;
      if (note.n_type == NT_GNU_BUILD_ID && note.n_namesz == 4 && note.n_descsz >= VK_UUID_SIZE) {
        std::memcpy(out, at + sizeof note + name, VK_UUID_SIZE);
        return 1;
      }
      at += whole;
      left -= whole;
    }
  }
  return 2;
}

}  // namespace

void buildUuid(uint8_t out[VK_UUID_SIZE]) {
  // Without the note, builds of one version cannot be told apart: the time of compiling must do.
  if (dl_iterate_phdr(findBuildId, out) == 1) return;
  driverUuid(out);
  const uint64_t compiled = base::hashBytes(__DATE__ __TIME__, sizeof(__DATE__ __TIME__));
  std::memcpy(out + VK_UUID_SIZE - sizeof compiled, &compiled, sizeof compiled);
}

ShaderKey wordsKey(std::span<const uint32_t> words) {
  return {base::hashBytes(words.data(), words.size_bytes(), 1), base::hashBytes(words.data(), words.size_bytes(), 2)};
}

ShaderKey shaderKey(const ShaderKey& words, frontend::Stage stage, std::string_view entryPoint, std::span<const frontend::SpecializationConstant> constants) {
  ShaderKey key;
  // A shader that is watched is another shader: neither run may find the other's in its cache.
  const uint64_t watched = ir::wantedChecks() & ir::kAllChecks;
  for (uint64_t i = 0; i < key.size(); i++) {
    uint64_t h = base::hashCombine(words[i], uint64_t(stage) | i << 32 | watched << 40);
    h = base::hashCombine(h, base::hashBytes(entryPoint.data(), entryPoint.size(), i));
    for (const auto& c : constants) h = base::hashCombine(base::hashCombine(h, c.id), base::hashBytes(c.data.data(), c.data.size(), i));
    key[i] = h;
  }
  return key;
}

void PipelineCache::load(const VkPhysicalDeviceProperties& device, std::span<const std::byte> blob) {
  VkPipelineCacheHeaderVersionOne header;
  if (blob.size() < sizeof header) return;
  std::memcpy(&header, blob.data(), sizeof header);
  if (header.headerSize != sizeof header || header.headerVersion != VK_PIPELINE_CACHE_HEADER_VERSION_ONE || header.vendorID != device.vendorID ||
      header.deviceID != device.deviceID || std::memcmp(header.pipelineCacheUUID, device.pipelineCacheUUID, VK_UUID_SIZE))
    return;
  blob = blob.subspan(sizeof header);
  std::lock_guard lock(mutex_);
  while (blob.size() >= kEntryHeader) {
    EntryHeader entry;
    std::memcpy(&entry, blob.data(), kEntryHeader);
    blob = blob.subspan(kEntryHeader);
    if (entry.size > blob.size()) return;
    const auto content = blob.first(entry.size);
    blob = blob.subspan(entry.size);
    if (checksumOf(content) != entry.checksum) continue;
    const std::array<uint64_t, 2> key{entry.key[0], entry.key[1]};
    if (entry.content == Content::Shader) {
      entries_[key].bytes.assign(content.begin(), content.end());
    } else if (entry.content == Content::Routines) {
      if (auto routines = pipeline::SavedPipeline::fromBytes(content)) routines_->insert(key, std::move(routines));
    }
  }
}

std::shared_ptr<const frontend::Shader> PipelineCache::find(const ShaderKey& key) {
  std::lock_guard lock(mutex_);
  auto it = entries_.find(key);
  if (it == entries_.end()) return nullptr;
  if (!it->second.shader) it->second.shader = frontend::fromBytes(it->second.bytes);
  if (auto shader = it->second.shader) return shader;
  entries_.erase(it);
  return nullptr;
}

void PipelineCache::insert(const ShaderKey& key, std::shared_ptr<const frontend::Shader> shader) {
  std::lock_guard lock(mutex_);
  Entry& entry = entries_[key];
  if (!entry.shader) entry = {{}, std::move(shader)};
}

void PipelineCache::merge(PipelineCache& other) {
  if (&other == this) return;
  std::scoped_lock lock(mutex_, other.mutex_);
  for (const auto& [key, entry] : other.entries_) entries_.try_emplace(key, entry);
  routines_->merge(*other.routines_);
}

VkResult PipelineCache::write(const VkPhysicalDeviceProperties& device, size_t& size, std::byte* out) {
  std::lock_guard lock(mutex_);
  VkPipelineCacheHeaderVersionOne header{sizeof header, VK_PIPELINE_CACHE_HEADER_VERSION_ONE, device.vendorID, device.deviceID, {}};
  std::memcpy(header.pipelineCacheUUID, device.pipelineCacheUUID, VK_UUID_SIZE);
  size_t needed = sizeof header;
  for (auto& [key, entry] : entries_) {
    if (entry.bytes.empty()) entry.bytes = frontend::toBytes(*entry.shader);
    needed += kEntryHeader + entry.bytes.size();
  }
  std::vector<std::pair<ShaderKey, std::vector<std::byte>>> routines;
  for (const auto& [key, pipeline] : routines_->pipelines()) {
    routines.emplace_back(key, pipeline->toBytes());
    needed += kEntryHeader + routines.back().second.size();
  }
  if (!out) {
    size = needed;
    return VK_SUCCESS;
  }
  // A header that does not fit is not written in part, nor is an entry.
  if (size < sizeof header) {
    size = 0;
    return VK_INCOMPLETE;
  }
  std::byte* at = out;
  put(at, &header, sizeof header);
  const auto putEntry = [&](const ShaderKey& key, Content content, const std::vector<std::byte>& bytes) {
    if (kEntryHeader + bytes.size() > size - size_t(at - out)) return false;
    const EntryHeader entry{{key[0], key[1]}, checksumOf(bytes), uint32_t(bytes.size()), content};
    put(at, &entry, kEntryHeader);
    put(at, bytes.data(), bytes.size());
    return true;
  };
  bool whole = true;
  for (const auto& [key, entry] : entries_) whole = whole && putEntry(key, Content::Shader, entry.bytes);
  for (const auto& [key, bytes] : routines) whole = whole && putEntry(key, Content::Routines, bytes);
  size = size_t(at - out);
  return whole ? VK_SUCCESS : VK_INCOMPLETE;
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreatePipelineCache(VkDevice handle, const VkPipelineCacheCreateInfo* info, const VkAllocationCallbacks* callbacks, VkPipelineCache* out) {
  auto* cache = from(handle)->make<PipelineCache>(callbacks);
  if (!cache) return VK_ERROR_OUT_OF_HOST_MEMORY;
  try {
    cache->load(from(handle)->physical.properties, {static_cast<const std::byte*>(info->pInitialData), info->initialDataSize});
  } catch (const std::bad_alloc&) {
    from(handle)->destroy(callbacks, cache);
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  *out = to<VkPipelineCache>(cache);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyPipelineCache(VkDevice device, VkPipelineCache cache, const VkAllocationCallbacks* callbacks) { from(device)->destroy(callbacks, from(cache)); }

VKAPI_ATTR VkResult VKAPI_CALL vkGetPipelineCacheData(VkDevice device, VkPipelineCache cache, size_t* size, void* out) {
  try {
    return from(cache)->write(from(device)->physical.properties, *size, static_cast<std::byte*>(out));
  } catch (const std::bad_alloc&) {
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
}

VKAPI_ATTR VkResult VKAPI_CALL vkMergePipelineCaches(VkDevice, VkPipelineCache to, uint32_t count, const VkPipelineCache* caches) {
  try {
    for (uint32_t i = 0; i < count; i++) from(to)->merge(*from(caches[i]));
  } catch (const std::bad_alloc&) {
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  return VK_SUCCESS;
}

}  // namespace pumice::icd
