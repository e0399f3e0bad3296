// Blits, resolves and presentation: conversions that run the sampling and packing builders once per pixel (Vulkan spec, "Image
// Copies With Scaling", "Resolving Multisample Images").
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "base/fpenv.h"
#include "texture/address.h"
#include "texture/cleared.h"
#include "texture/pixel_routine.h"
#include "texture/rows.h"

namespace pumice::texture {
namespace {

using ir::Builder;
using ir::Op;
using ir::Type;
using ir::Value;

constexpr uint32_t kSourceTable = ir::kTableSet0, kTargetTable = ir::kTableSet0 + 1;

// What a blit routine reads as draw constants, per axis: u = (x + 1/2 - target) * numerator / denominator + source.
struct BlitParameters {
  float target[3];
  float numerator[3];
  float denominator[3];
  float source[3];
  int32_t resolveShift[2];  // of resolves: source minus target
};

struct BlitTables {
  CombinedDescriptor source;
  ImageDescriptor target;
  BlitParameters parameters{};

  void fill(interp::Tables& tables) const {
    const ConstantTable constants = constantTable();
    tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(&parameters), sizeof(parameters)};
    tables[kSourceTable] = {reinterpret_cast<const std::byte*>(&source), sizeof(source)};
    tables[kTargetTable] = {reinterpret_cast<const std::byte*>(&target), sizeof(target)};
    tables[ir::kTableConstants] = {constants.data, constants.size};
  }
};

ImageDescriptor describe(const ImageMemory& image, const PlaneLayout& plane, uint32_t level, uint32_t layer) {
  const LevelLayout& l = plane.levels[level];
  const uint64_t begin = plane.offset + layer * plane.layerPitch;
  ImageDescriptor d;
  d.base = reinterpret_cast<uint64_t>(image.base + begin);
  d.levels = reinterpret_cast<uint64_t>(&l);
  d.layerPitch = plane.layerPitch;
  d.samplePitch = plane.samplePitch;
  d.size = image.layout->size - begin;
  d.width = l.width;
  d.height = l.height;
  d.depth = l.depth;
  d.layerCount = 1;
  d.levelCount = 1;
  d.samples = image.layout->samples;
  return d;
}

ImageRef reference(uint32_t table, VkFormat format, uint8_t addressing, Builder& b) {
  ImageRef r;
  r.table = table;
  r.dynamicOffset = b.i32(0);
  r.key.format = formatKey(*formatInfo(format));
  r.key.viewType = VK_IMAGE_VIEW_TYPE_2D;
  r.key.tiled = addressing;
  r.key.aspect = VK_IMAGE_ASPECT_COLOR_BIT;  // the format is a plane's own
  r.key.samples = 1;
  r.key.singleLevel = 1;
  return r;
}

// A format of the same element size whose texels are plain words: a blit without conversion moves bits.
VkFormat wordFormat(const FormatInfo& f) {
  switch (f.elementBytes) {
    case 1: return VK_FORMAT_R8_UINT;
    case 2: return VK_FORMAT_R16_UINT;
    case 3: return VK_FORMAT_R8G8B8_UINT;
    case 4: return VK_FORMAT_R32_UINT;
    case 6: return VK_FORMAT_R16G16B16_UINT;
    case 8: return VK_FORMAT_R32G32_UINT;
    case 12: return VK_FORMAT_R32G32B32_UINT;
    case 16: return VK_FORMAT_R32G32B32A32_UINT;
    default: return f.format;
  }
}

void storePixel(Builder& b, const FormatInfo& f, const RoutineKey& key, Value x, Value y, Value z, const Texel& t) {
  ImageRef target = reference(kTargetTable, f.format, key.targetAddressing, b);
  SliceAddress slice = sliceAddress({b, target}, 0, 0, z, 0);
  storeTexel(b, f, slice.base, elementOffset(b, slice, isTiled(target.key), f.elementBytes, x, y), slice.size, t);
}

std::shared_ptr<const interp::Executable> blitRoutine(const RoutineKey& key) {
  return pixelRoutine(key, [&](Builder& b) {
    const FormatInfo& source = allFormats()[key.sourceFormat - 1];
    const FormatInfo& target = allFormats()[key.targetFormat - 1];
    Value at[3] = {b.input(Type::I32, 0), b.input(Type::I32, 1), b.input(Type::I32, 2)};
    std::vector<Value> operands = {b.i32(0), b.i32(0)};
    for (uint32_t i = 0; i < key.dimensions; ++i) {
      auto parameter = [&](size_t offset) { return b.uniform(Type::F32, uint32_t(offset + 4 * i)); };
      Value centre = b.fadd(b.convert(Op::UToF, Type::F32, at[i]), b.f32(0.5f));
      Value distance = b.fsub(centre, parameter(offsetof(BlitParameters, target)));
      Value scaled = b.fdiv(b.fmul(distance, parameter(offsetof(BlitParameters, numerator))), parameter(offsetof(BlitParameters, denominator)));
      operands.push_back(b.fadd(scaled, parameter(offsetof(BlitParameters, source))));
    }
    ir::ImageOpInfo op;
    op.kind = ir::ImageKind::Sample;
    op.dim = key.dimensions == 3 ? ir::ImageDim::D3 : ir::ImageDim::D2;
    op.texelType = source.isInteger() ? Type::I32 : Type::F32;
    SamplerRef sampler;
    sampler.table = kSourceTable;
    sampler.constOffset = offsetof(CombinedDescriptor, sampler);
    sampler.dynamicOffset = b.i32(0);
    sampler.key.present = 1;
    sampler.key.unnormalized = 1;
    sampler.key.magFilter = sampler.key.minFilter = key.linearFilter ? VK_FILTER_LINEAR : VK_FILTER_NEAREST;
    sampler.key.addressU = sampler.key.addressV = sampler.key.addressW = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
    const char* error = nullptr;
    std::vector<Value> texel = expandImage(b, op, operands, reference(kSourceTable, source.format, key.sourceAddressing, b), sampler, &error);
    if (texel.size() != 4) return;
    Texel t = {texel[0], texel[1], texel[2], texel[3]};
    storePixel(b, target, key, at[0], at[1], at[2], t);
  });
}

// One axis of a blit: target pixels [begin, end) and the mapping.
struct BlitAxis {
  uint32_t begin = 0, end = 0;
};
BlitAxis blitAxis(BlitParameters& p, int i, int32_t s0, int32_t s1, int32_t d0, int32_t d1, uint32_t limit) {
  p.target[i] = float(d0);
  p.numerator[i] = float(s1 - s0);
  p.denominator[i] = float(d1 - d0);
  p.source[i] = float(s0);
  const int64_t low = std::clamp<int64_t>(std::min(d0, d1), 0, limit), high = std::clamp<int64_t>(std::max(d0, d1), 0, limit);
  return {uint32_t(low), uint32_t(high)};
}

// Presentation converts to this format; the bits of sRGB formats go to the window as they are.
constexpr VkFormat kPresentFormat = VK_FORMAT_B8G8R8A8_UNORM;
VkFormat withoutSrgb(VkFormat format) {
  switch (format) {
    case VK_FORMAT_R8G8B8A8_SRGB: return VK_FORMAT_R8G8B8A8_UNORM;
    case VK_FORMAT_B8G8R8A8_SRGB: return VK_FORMAT_B8G8R8A8_UNORM;
    case VK_FORMAT_A8B8G8R8_SRGB_PACK32: return VK_FORMAT_A8B8G8R8_UNORM_PACK32;
    default: return format;
  }
}

// One row of blocks to four rows of pixels; kSwap exchanges the first and third byte.
template <bool kSwap>
void presentBlocks(const uint32_t* blocks, std::byte* rows, uint64_t pitch, uint32_t width, uint32_t height) {
  uint32_t x = 0;
#if defined(__SSE2__)
  // A quad is one vector; two neighbours hold two rows of four pixels. Nobody here reads the rows again, so they go past the caches.
  if (height == 4 && (reinterpret_cast<uintptr_t>(rows) | pitch) % 16 == 0) {
    const __m128i kept = _mm_set1_epi32(int(0xff00ff00)), low = _mm_set1_epi32(0xff);
    for (; x + 4 <= width; x += 4, blocks += 16) {
      __m128i quads[4];
      for (int q = 0; q < 4; ++q) {
        __m128i v = _mm_loadu_si128(reinterpret_cast<const __m128i*>(blocks) + q);
        if constexpr (kSwap)
          v = _mm_or_si128(_mm_and_si128(v, kept), _mm_or_si128(_mm_and_si128(_mm_srli_epi32(v, 16), low), _mm_slli_epi32(_mm_and_si128(v, low), 16)));
        quads[q] = v;
      }
      auto store = [&](uint32_t y, __m128i v) { _mm_stream_si128(reinterpret_cast<__m128i*>(rows + y * pitch + uint64_t(x) * 4), v); };
      store(0, _mm_unpacklo_epi64(quads[0], quads[1]));
      store(1, _mm_unpackhi_epi64(quads[0], quads[1]));
      store(2, _mm_unpacklo_epi64(quads[2], quads[3]));
      store(3, _mm_unpackhi_epi64(quads[2], quads[3]));
    }
    _mm_sfence();
  }
#endif
  for (; x < width; x += 4, blocks += 16) {
    uint32_t pixels[16];
    for (int i = 0; i < 16; ++i) {
      uint32_t v = blocks[i];
      pixels[i] = kSwap ? (v & 0xff00ff00u) | (v >> 16 & 0xff) | (v & 0xff) << 16 : v;
    }
    const uint32_t columns = std::min(4u, width - x);
    for (uint32_t y = 0; y < height; ++y) {
      std::byte* out = rows + y * pitch + uint64_t(x) * 4;
      const uint32_t* quad = pixels + blockIndex(0, y);
      if (columns == 4) {
        std::memcpy(out, quad, 8);
        std::memcpy(out + 8, quad + 4, 8);
      } else {
        for (uint32_t c = 0; c < columns; ++c) std::memcpy(out + 4 * c, quad + blockIndex(c, 0), 4);
      }
    }
  }
}

// A blit that neither scales nor converts is a copy.
bool isCopy(const ImageLayout& from, const ImageLayout& to, const VkImageBlit& r) {
  auto fits = [](const VkOffset3D (&o)[2], const LevelLayout& l) {
    return o[0].x >= 0 && o[0].y >= 0 && o[0].z >= 0 && o[0].x < o[1].x && o[0].y < o[1].y && o[0].z < o[1].z && uint32_t(o[1].x) <= l.width &&
           uint32_t(o[1].y) <= l.height && uint32_t(o[1].z) <= l.depth;
  };
  auto equal = [&](int32_t VkOffset3D::*c) { return r.srcOffsets[1].*c - r.srcOffsets[0].*c == r.dstOffsets[1].*c - r.dstOffsets[0].*c; };
  return from.format == to.format && !from.format->isCompressed() && from.type == to.type && from.samples == 1 && to.samples == 1 &&
         r.srcSubresource.aspectMask == r.dstSubresource.aspectMask && fits(r.srcOffsets, from.planes[0].levels[r.srcSubresource.mipLevel]) &&
         fits(r.dstOffsets, to.planes[0].levels[r.dstSubresource.mipLevel]) && equal(&VkOffset3D::x) && equal(&VkOffset3D::y) && equal(&VkOffset3D::z);
}

}  // namespace

void blitImage(base::ThreadPool& pool, const ImageMemory& src, const ImageMemory& dst, const VkImageBlit& region, VkFilter filter) {
  writeCleared(src);
  writeCleared(dst);
  const ImageLayout &from = *src.layout, &to = *dst.layout;
  const VkImageSubresourceLayers &ss = region.srcSubresource, &ds = region.dstSubresource;
  if (ss.mipLevel >= from.mipLevels || ds.mipLevel >= to.mipLevels) return;
  if (isCopy(from, to, region)) {
    const VkOffset3D *s = region.srcOffsets, *d = region.dstOffsets;
    return copyImage(pool, src, dst, {ss, s[0], ds, d[0], {uint32_t(s[1].x - s[0].x), uint32_t(s[1].y - s[0].y), uint32_t(s[1].z - s[0].z)}});
  }
  constexpr VkImageAspectFlags kAspects[] = {VK_IMAGE_ASPECT_COLOR_BIT, VK_IMAGE_ASPECT_DEPTH_BIT, VK_IMAGE_ASPECT_STENCIL_BIT};
  for (VkImageAspectFlags aspect : kAspects) {
    if (!(ss.aspectMask & ds.aspectMask & aspect)) continue;
    const PlaneLayout &sp = from.plane(aspect), &dp = to.plane(aspect);
    const FormatInfo &sf = planeFormat(*from.format, aspect), &df = planeFormat(*to.format, aspect);
    const LevelLayout& level = dp.levels[ds.mipLevel];

    RoutineKey key;
    key.kind = RoutineKey::Blit;
    key.dimensions = from.type == VK_IMAGE_TYPE_3D ? 3 : 2;
    key.linearFilter = filter == VK_FILTER_LINEAR && !sf.isInteger();
    key.sourceAddressing = addressing(from.tiled, from.size);
    key.targetAddressing = addressing(to.tiled, to.size);
    const bool bits = sf.format == df.format && !key.linearFilter;
    key.sourceFormat = formatKey(bits ? *formatInfo(wordFormat(sf)) : sf);
    key.targetFormat = formatKey(bits ? *formatInfo(wordFormat(df)) : df);
    auto routine = blitRoutine(key);
    if (!routine) continue;

    BlitTables data;
    const VkOffset3D *s = region.srcOffsets, *d = region.dstOffsets;
    BlitAxis x = blitAxis(data.parameters, 0, s[0].x, s[1].x, d[0].x, d[1].x, level.width);
    BlitAxis y = blitAxis(data.parameters, 1, s[0].y, s[1].y, d[0].y, d[1].y, level.height);
    BlitAxis z = blitAxis(data.parameters, 2, s[0].z, s[1].z, d[0].z, d[1].z, level.depth);
    for (uint32_t layer = 0; layer < std::min(ss.layerCount, ds.layerCount); ++layer) {
      if (ss.baseArrayLayer + layer >= from.arrayLayers || ds.baseArrayLayer + layer >= to.arrayLayers) break;
      data.source.image = describe(src, sp, ss.mipLevel, ss.baseArrayLayer + layer);
      data.target = describe(dst, dp, ds.mipLevel, ds.baseArrayLayer + layer);
      interp::Tables tables{};
      data.fill(tables);
      runPixels(pool, *routine, tables, {x.begin, y.begin, z.begin, x.end - x.begin, y.end - y.begin, z.end - z.begin});
    }
  }
}

// The routine of a resolve. With `agreeing` samples the same sum is formed of the first one alone, so the bits are the same.
static std::shared_ptr<const interp::Executable> resolveRoutine(const ImageLayout& from, const ImageLayout& to, bool agreeing) {
  RoutineKey key;
  key.kind = RoutineKey::Resolve;
  key.sourceAddressing = addressing(from.tiled, from.size);
  key.targetAddressing = addressing(to.tiled, to.size);
  key.samples = uint8_t(from.samples);
  key.sourceFormat = formatKey(*from.format);
  key.targetFormat = formatKey(*to.format);
  key.agreeing = agreeing;
  return pixelRoutine(key, [&](Builder& b) {
    const FormatInfo& f = *from.format;
    Value x = b.input(Type::I32, 0), y = b.input(Type::I32, 1), z = b.input(Type::I32, 2);
    Value sx = b.iadd(x, b.uniform(Type::I32, offsetof(BlitParameters, resolveShift)));
    Value sy = b.iadd(y, b.uniform(Type::I32, offsetof(BlitParameters, resolveShift) + 4));
    ImageRef source = reference(kSourceTable, f.format, key.sourceAddressing, b);
    auto sample = [&](uint32_t i) {
      SliceAddress slice = sliceAddress({b, source}, 0, 0, 0, i ? b.i32(i) : 0);
      return loadTexel(b, f, slice.base, elementOffset(b, slice, isTiled(source.key), f.elementBytes, sx, sy), slice.size, true);
    };
    Texel sum = sample(0);
    if (!f.isInteger() && from.samples > 1) {
      // One fixed tree, so that the order of additions is the same everywhere.
      std::vector<Texel> level = {sum};
      for (uint32_t i = 1; i < from.samples; ++i) level.push_back(agreeing ? sum : sample(i));
      for (; level.size() > 1; level.resize(level.size() / 2))
        for (size_t i = 0; i < level.size() / 2; ++i)
          for (int c = 0; c < 4; ++c) level[i][c] = b.fadd(level[2 * i][c], level[2 * i + 1][c]);
      for (int c = 0; c < 4; ++c) sum[c] = b.fmul(level[0][c], b.f32(1.0f / float(from.samples)));
    }
    storePixel(b, *to.format, key, x, y, z, sum);
  });
}

// The target's pixels that a resolve writes; empty if there are none.
static VkRect2D resolveTarget(const ImageLayout& from, const ImageLayout& to, const VkImageResolve& region) {
  const VkImageSubresourceLayers &ss = region.srcSubresource, &ds = region.dstSubresource;
  if (ss.mipLevel >= from.mipLevels || ds.mipLevel >= to.mipLevels || from.format->isDepthStencil()) return {};
  const LevelLayout &sl = from.planes[0].levels[ss.mipLevel], &dl = to.planes[0].levels[ds.mipLevel];
  const VkOffset3D s = region.srcOffset, d = region.dstOffset;
  if (s.x < 0 || s.y < 0 || d.x < 0 || d.y < 0 || uint32_t(d.x) >= dl.width || uint32_t(d.y) >= dl.height || uint32_t(s.x) >= sl.width ||
      uint32_t(s.y) >= sl.height)
    return {};
  return {{d.x, d.y}, {std::min({region.extent.width, dl.width - uint32_t(d.x), sl.width - uint32_t(s.x)}),
                       std::min({region.extent.height, dl.height - uint32_t(d.y), sl.height - uint32_t(s.y)})}};
}

void resolveImage(base::ThreadPool& pool, const ImageMemory& src, const ImageMemory& dst, const VkImageResolve& region) {
  writeCleared(src);
  writeCleared(dst);
  const ImageLayout &from = *src.layout, &to = *dst.layout;
  const VkImageSubresourceLayers &ss = region.srcSubresource, &ds = region.dstSubresource;
  const VkRect2D target = resolveTarget(from, to, region);
  if (!target.extent.width || !target.extent.height) return;
  auto routine = resolveRoutine(from, to, false);
  if (!routine) return;
  BlitTables data;
  data.parameters.resolveShift[0] = region.srcOffset.x - region.dstOffset.x;
  data.parameters.resolveShift[1] = region.srcOffset.y - region.dstOffset.y;
  for (uint32_t layer = 0; layer < std::min(ss.layerCount, ds.layerCount); ++layer) {
    if (ss.baseArrayLayer + layer >= from.arrayLayers || ds.baseArrayLayer + layer >= to.arrayLayers) break;
    data.source.image = describe(src, from.planes[0], ss.mipLevel, ss.baseArrayLayer + layer);
    data.target = describe(dst, to.planes[0], ds.mipLevel, ds.baseArrayLayer + layer);
    interp::Tables tables{};
    data.fill(tables);
    runPixels(pool, *routine, tables, {uint32_t(target.offset.x), uint32_t(target.offset.y), 0, target.extent.width, target.extent.height, 1});
  }
}

BlockResolve::BlockResolve(const ImageMemory& src, const ImageMemory& dst, const VkImageResolve& region) : src_(src), dst_(dst), region_(region) {
  target_ = resolveTarget(*src.layout, *dst.layout, region);
  // What is decoded, averaged with itself and packed again comes out as it was; not so NaN, -128 of SNORM, and bits that mean nothing.
  const FormatInfo& f = *src.layout->format;
  copies_ = src.layout->tiled && dst.layout->tiled && f.format == dst.layout->format->format && !f.isCompressed();
  uint32_t bits = 0;
  for (const Component& c : f.rgba) bits += c.bits;
  copies_ &= bits == 8 * f.elementBytes;
  for (const Component& c : f.rgba)
    copies_ &= !c.bits || c.numeric == Numeric::Unorm || c.numeric == Numeric::Uint || c.numeric == Numeric::Sint || c.numeric == Numeric::Srgb;
}

void BlockResolve::blocks(uint32_t layer, std::span<const Block> blocks, bool agreeing) const {
  const ImageLayout &from = *src_.layout, &to = *dst_.layout;
  const VkImageSubresourceLayers &ss = region_.srcSubresource, &ds = region_.dstSubresource;
  if (blocks.empty() || ss.baseArrayLayer + layer >= from.arrayLayers || ds.baseArrayLayer + layer >= to.arrayLayers) return;
  const uint32_t x0 = uint32_t(target_.offset.x), x1 = x0 + target_.extent.width;
  const uint32_t y0 = uint32_t(target_.offset.y), y1 = y0 + target_.extent.height;
  const PlaneLayout &sp = from.planes[0], &dp = to.planes[0];
  const bool copies = copies_ && agreeing;
  std::shared_ptr<const interp::Executable> routine;   // made when needed
  interp::UniformBank bank;
  BlitTables data;
  interp::Tables tables{};
  alignas(64) uint32_t rows[3][interp::kMaxLanes] = {};
  const void* inputs[] = {rows[0], rows[1], rows[2]};
  interp::ExecContext context;
  context.lanes = 0;
  std::fill(std::begin(context.active), std::end(context.active), 0);
  const auto run = [&] {
    if (!context.lanes) return;
    if (!routine) {
      routine = resolveRoutine(from, to, agreeing);
      if (!routine) return;
      data.source.image = describe(src_, sp, ss.mipLevel, ss.baseArrayLayer + layer);
      data.target = describe(dst_, dp, ds.mipLevel, ds.baseArrayLayer + layer);
      data.fill(tables);
      bank = routine->preamble(tables);
      context.inputs = inputs;
      context.tables = tables;
    }
    routine->run(bank, context);
    context.lanes = 0;
    std::fill(std::begin(context.active), std::end(context.active), 0);
  };
  const base::ScopedFpEnv environment;
  for (const Block b : blocks) {
    if (copies && b.x >= x0 && b.y >= y0 && b.x + 4u <= x1 && b.y + 4u <= y1) {
      const auto at = [&](const ImageMemory& m, const PlaneLayout& p, const VkImageSubresourceLayers& s) {
        const LevelLayout& l = p.levels[s.mipLevel];
        return m.base + p.offset + (s.baseArrayLayer + layer) * p.layerPitch + l.offset + uint64_t(b.y / 4) * l.rowPitch + uint64_t(b.x) * 4 * p.elementBytes;
      };
      std::memcpy(at(dst_, dp, ds), at(src_, sp, ss), 16 * sp.elementBytes);
      continue;
    }
    uint32_t inside = 0;
    for (uint32_t y = 0; y < 4; ++y)
      for (uint32_t x = 0; x < 4; ++x) {
        const uint32_t i = blockIndex(x, y), px = b.x + x, py = b.y + y;
        rows[0][context.lanes + i] = px;
        rows[1][context.lanes + i] = py;
        inside |= uint32_t(px >= x0 && px < x1 && py >= y0 && py < y1) << i;
      }
    if (!inside) continue;
    context.active[context.lanes >> 6] |= uint64_t(inside) << (context.lanes & 63);
    context.lanes += 16;
    if (context.lanes == interp::kMaxLanes) run();
  }
  run();
}

void presentRows(base::ThreadPool& pool, const ImageMemory& src, std::byte* rows, uint64_t pitch, VkExtent2D extent) {
  const ImageLayout& from = *src.layout;
  const PlaneLayout& plane = from.planes[0];
  const LevelLayout& level = plane.levels[0];
  const uint32_t width = std::min(extent.width, level.width), height = std::min(extent.height, level.height);
  const VkFormat format = withoutSrgb(from.format->format);
  const bool swap = format == VK_FORMAT_R8G8B8A8_UNORM || format == VK_FORMAT_A8B8G8R8_UNORM_PACK32;
  if (from.tiled && (swap || format == VK_FORMAT_B8G8R8A8_UNORM)) {
    const std::byte* base = src.base + plane.offset;
    ClearedTiles* cleared = src.cleared;
    std::byte pattern[32];
    uint64_t converted = uint64_t(width) * height * 4;
    if (cleared) {
      std::byte pixel[4];
      std::memcpy(pixel, cleared->element, 4);
      if (swap) std::swap(pixel[0], pixel[2]);
      for (int i = 0; i < 8; ++i) std::memcpy(pattern + 4 * i, pixel, 4);
      converted = uint64_t(std::count(cleared->marks.begin(), cleared->marks.end(), 0)) * ClearedTiles::kEdge * ClearedTiles::kEdge * 4;
    }
    const auto convert = [&](uint32_t begin, uint32_t end) {
      for (uint32_t i = begin; i < end; ++i) {
        const uint32_t lines = std::min(4u, height - 4 * i);
        std::byte* out = rows + uint64_t(4) * i * pitch;
        for (uint32_t x = 0, run; x < width; x += run) {
          const uint32_t tileY = 4 * i / ClearedTiles::kEdge;
          run = cleared ? cleared->run(x, tileY, width) : width;
          if (cleared && cleared->mark(x / ClearedTiles::kEdge, tileY)) {
            for (uint32_t y = 0; y < lines; ++y) fillBytes(out + y * pitch + uint64_t(x) * 4, uint64_t(run) * 4, pattern, Store::kCached);
            continue;
          }
          auto blocks = reinterpret_cast<const uint32_t*>(base + i * level.rowPitch) + uint64_t(x) * 4;
          (swap ? presentBlocks<true> : presentBlocks<false>)(blocks, out + uint64_t(x) * 4, pitch, run, lines);
        }
      }
    };
    // Rows that are only filled are not worth another thread.
    if (converted < kParallelBytes) convert(0, (height + 3) / 4);
    else parallelRanges(pool, (height + 3) / 4, uint64_t(width) * 16, convert);
    return;
  }
  writeCleared(src);

  RoutineKey key;
  key.kind = RoutineKey::Blit;
  key.sourceAddressing = addressing(from.tiled, from.size);
  key.targetAddressing = addressing(false, pitch * height);
  key.sourceFormat = formatKey(*formatInfo(format));
  key.targetFormat = formatKey(*formatInfo(kPresentFormat));
  auto routine = blitRoutine(key);
  if (!routine) return;
  LevelLayout out;
  out.rowPitch = pitch;
  out.slicePitch = pitch * height;
  BlitTables data;
  for (int i = 0; i < 3; ++i) data.parameters.numerator[i] = data.parameters.denominator[i] = 1.0f;
  data.source.image = describe(src, plane, 0, 0);
  data.target.base = reinterpret_cast<uint64_t>(rows);
  data.target.levels = reinterpret_cast<uint64_t>(&out);
  data.target.size = out.slicePitch;
  data.target.levelCount = 1;
  interp::Tables tables{};
  data.fill(tables);
  runPixels(pool, *routine, tables, {0, 0, 0, width, height, 1});
}

}  // namespace pumice::texture
