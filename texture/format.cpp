#include "texture/format.h"

#include <array>
#include <string_view>

namespace pumice::texture {
namespace {

// What the rooms above implement; capability queries follow these and the table alone.
constexpr bool kSampleCompressed = true;       // block decoding: texture/block.h
constexpr bool kStorage = true;                // image reads, writes and atomics in expandImage()
constexpr VkSampleCountFlags kSampleCounts = VK_SAMPLE_COUNT_1_BIT | VK_SAMPLE_COUNT_2_BIT | VK_SAMPLE_COUNT_4_BIT | VK_SAMPLE_COUNT_8_BIT | VK_SAMPLE_COUNT_16_BIT;

struct NumericName {
  std::string_view text;
  Numeric numeric;
};
constexpr NumericName kNumericNames[] = {
    {"UNORM", Numeric::Unorm}, {"SNORM", Numeric::Snorm}, {"USCALED", Numeric::Uscaled}, {"SSCALED", Numeric::Sscaled},
    {"UINT", Numeric::Uint},   {"SINT", Numeric::Sint},   {"UFLOAT", Numeric::Ufloat},   {"SFLOAT", Numeric::Sfloat},
    {"SRGB", Numeric::Srgb},
};
constexpr std::string_view kBlockNames[] = {"BC1", "BC2", "BC3", "BC4", "BC5", "BC6H", "BC7"};

constexpr bool isDigit(char c) { return c >= '0' && c <= '9'; }

// A letter of a component list: its place in FormatInfo::rgba, or -1 for padding and the shared exponent.
constexpr int componentIndex(char letter) {
  switch (letter) {
    case 'R': case 'D': return 0;
    case 'G': case 'S': return 1;
    case 'B': return 2;
    case 'A': return 3;
    default: return -1;
  }
}

struct Field {
  char letter = 0;
  uint8_t bits = 0;
  Numeric numeric = Numeric::None;
};

//! Format of a plane with this many components of this many bits (spec, "Formats of planes of multi-planar formats").
constexpr VkFormat planeFormatOf(unsigned bits, unsigned components) {
  switch (bits) {
    case 8: return components == 1 ? VK_FORMAT_R8_UNORM : VK_FORMAT_R8G8_UNORM;
    case 10: return components == 1 ? VK_FORMAT_R10X6_UNORM_PACK16 : VK_FORMAT_R10X6G10X6_UNORM_2PACK16;
    case 12: return components == 1 ? VK_FORMAT_R12X4_UNORM_PACK16 : VK_FORMAT_R12X4G12X4_UNORM_2PACK16;
    default: return components == 1 ? VK_FORMAT_R16_UNORM : VK_FORMAT_R16G16_UNORM;
  }
}

// Reads a format's name: lists of letter and bit count, each followed by a numeric type; PACKn says that the list
// runs from the highest bits of one word downwards instead of upwards in memory, nPACK16 that each of n words does. Several lists
// before nPLANE are planes.
constexpr FormatInfo parseFormat(VkFormat format, const char* name) {
  FormatInfo f{};
  f.format = format;
  f.name = name;
  f.blockWidth = f.blockHeight = 1;
  f.compression = Compression::None;

  f.planeCount = 1;

  std::array<Field, 8> fields{};
  std::array<size_t, 4> planeStart{};
  size_t count = 0, untyped = 0, lists = 0;
  std::string_view rest = name;
  std::string_view channels;
  while (!rest.empty()) {
    size_t end = rest.find('_');
    std::string_view token = rest.substr(0, end);
    rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);

    bool known = false;
    for (size_t i = 0; i < std::size(kBlockNames); ++i) {
      if (token == kBlockNames[i]) {
        f.compression = Compression(i + 1);
        channels = i == 3 ? "R" : i == 4 ? "RG" : i == 5 ? "RGB" : "RGBA";
        known = true;
      }
    }
    for (const NumericName& n : kNumericNames) {
      if (token != n.text) continue;
      for (char c : channels) fields[count++] = {c, uint8_t(f.compression == Compression::Bc6h ? 16 : 8), Numeric::None};
      for (; untyped < count; ++untyped) fields[untyped].numeric = n.numeric;
      known = true;
    }
    if (known || token == "BLOCK") continue;
    if (f.compression != Compression::None) {
      channels = token;  // BC1_RGB and BC1_RGBA
      continue;
    }
    if (token.substr(0, 4) == "PACK") {
      f.flags |= kPacked;
      continue;
    }
    if (isDigit(token[0])) {
      if (token.substr(1) == "PLANE") f.planeCount = uint8_t(token[0] - '0');
      else if (token.substr(1) == "PACK16") f.flags |= kPadded16;
      else f.chromaShift[0] = token != "444", f.chromaShift[1] = token == "420";
      continue;
    }
    if (lists < planeStart.size()) planeStart[lists++] = count;
    for (size_t i = 0; i < token.size();) {
      Field& field = fields[count++];
      field.letter = token[i++];
      while (i < token.size() && isDigit(token[i])) field.bits = uint8_t(field.bits * 10 + (token[i++] - '0'));
    }
  }

  bool combined = false;
  unsigned total = 0;
  for (size_t i = 0; i < count; ++i) {
    if (fields[i].letter == 'D') f.flags |= kDepth;
    if (fields[i].letter == 'S') f.flags |= kStencil;
    if (fields[i].letter == 'E') f.flags |= kSharedExponent;
    total += fields[i].bits;
  }
  combined = (f.flags & kDepth) && (f.flags & kStencil);

  unsigned position = (f.flags & kPacked) ? total : 0;
  for (size_t i = 0; i < count; ++i) {
    const Field& field = fields[i];
    if (f.flags & kPacked) position -= field.bits;
    int index = componentIndex(field.letter);
    if (index >= 0) {
      Numeric numeric = field.numeric == Numeric::Srgb && index == 3 ? Numeric::Unorm : field.numeric;
      bool ownPlane = f.flags & (kDepth | kStencil) && !(f.flags & kPacked);
      // In a word of 16 the padding that is named after a component lies below it.
      unsigned padding = f.flags & kPadded16 && i + 1 < count && fields[i + 1].letter == 'X' ? fields[i + 1].bits : 0;
      f.rgba[ownPlane && !combined ? 0 : index] = {field.bits, uint8_t(ownPlane ? 0 : position + padding), numeric};
    }
    if (!(f.flags & kPacked)) position += field.bits;
  }
  for (const Field& field : fields)
    if (field.letter == 'X' && !(f.flags & (kDepth | kStencil))) f.flags |= kPadded16;

  for (size_t p = 0; f.planeCount > 1 && p < f.planeCount; ++p) {
    const size_t end = p + 1 < f.planeCount ? planeStart[p + 1] : count;
    unsigned components = 0;
    for (size_t i = planeStart[p]; i < end; ++i) {
      int index = componentIndex(fields[i].letter);
      if (index < 0) continue;
      f.componentPlane[index] = uint8_t(p);
      f.componentInPlane[index] = uint8_t(components++);
    }
    f.planeFormats[p] = planeFormatOf(fields[planeStart[p]].bits, components);
  }

  if (f.compression != Compression::None) {
    f.blockWidth = f.blockHeight = 4;
    f.elementBytes = f.compression == Compression::Bc1 || f.compression == Compression::Bc4 ? 8 : 16;
    for (Component& c : f.rgba) c.shift = 0;
  } else if (f.flags & kDepth) {
    f.elementBytes = f.rgba[0].bits == 16 ? 2 : 4;  // the 24-bit planes are words
  } else {
    f.elementBytes = uint8_t(total / 8);   // of multi-planar formats nobody asks: their planes have formats
  }
  return f;
}

constexpr FormatInfo kFormats[] = {
#define PUMICE_FORMAT(name) parseFormat(VK_FORMAT_##name, #name),
#include "texture/format_table.inc"
#undef PUMICE_FORMAT
};

// The formats up to this one have the index value - 1.
constexpr size_t kDense = VK_FORMAT_BC7_SRGB_BLOCK;
constexpr bool tableIsDense() {
  for (size_t i = 0; i < kDense; ++i)
    if (size_t(kFormats[i].format) != i + 1) return false;
  return true;
}
static_assert(tableIsDense(), "format_table.inc must list the formats in the order of their values");

bool isScaled(const FormatInfo& f) { return f.rgba[0].numeric == Numeric::Uscaled || f.rgba[0].numeric == Numeric::Sscaled; }
bool isSrgb(const FormatInfo& f) { return f.rgba[0].numeric == Numeric::Srgb; }
bool isWide(const FormatInfo& f) { return f.rgba[0].bits == 64; }
bool powerOfTwo(uint32_t x) { return (x & (x - 1)) == 0; }
bool isWord(const FormatInfo& f) { return f.format == VK_FORMAT_R32_UINT || f.format == VK_FORMAT_R32_SINT; }

// Formats whose texels may be read and written by storage images and storage texel buffers.
bool storable(const FormatInfo& f) {
  return kStorage && !f.isCompressed() && !f.isDepthStencil() && !isScaled(f) && !isWide(f) && !isSrgb(f) && !(f.flags & kSharedExponent) &&
         powerOfTwo(f.elementBytes);
}

// A filter over several texels averages, or takes the smallest or largest.
constexpr VkFormatFeatureFlags2 kLinearFilter = VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_FILTER_LINEAR_BIT | VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_FILTER_MINMAX_BIT;
constexpr VkFormatFeatureFlags2 kTransfer = VK_FORMAT_FEATURE_2_TRANSFER_SRC_BIT | VK_FORMAT_FEATURE_2_TRANSFER_DST_BIT;

// What does not depend on the tiling of a colour image.
VkFormatFeatureFlags2 colorImageFeatures(const FormatInfo& f) {
  if (f.isCompressed()) {
    if (!kSampleCompressed) return kTransfer;
    return kTransfer | VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_BIT | kLinearFilter | VK_FORMAT_FEATURE_2_BLIT_SRC_BIT;
  }
  // Views of all planes are sampled through a conversion (ycbcr.cpp), each plane by itself like any format.
  if (f.isMultiPlanar())
    return kTransfer | VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_BIT | VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_FILTER_LINEAR_BIT |
           VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_YCBCR_CONVERSION_LINEAR_FILTER_BIT |
           VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_YCBCR_CONVERSION_SEPARATE_RECONSTRUCTION_FILTER_BIT |
           VK_FORMAT_FEATURE_2_MIDPOINT_CHROMA_SAMPLES_BIT | VK_FORMAT_FEATURE_2_COSITED_CHROMA_SAMPLES_BIT | VK_FORMAT_FEATURE_2_DISJOINT_BIT;
  if (isScaled(f) || isWide(f)) return kTransfer;
  VkFormatFeatureFlags2 features =
      kTransfer | VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_BIT | VK_FORMAT_FEATURE_2_BLIT_SRC_BIT | VK_FORMAT_FEATURE_2_BLIT_DST_BIT;
  if (!f.isInteger()) features |= kLinearFilter;
  return features;
}

}  // namespace

VkImageAspectFlags FormatInfo::aspects() const {
  if (isMultiPlanar()) return VK_IMAGE_ASPECT_PLANE_0_BIT | VK_IMAGE_ASPECT_PLANE_1_BIT | (planeCount > 2 ? VK_IMAGE_ASPECT_PLANE_2_BIT : 0);
  if (!isDepthStencil()) return VK_IMAGE_ASPECT_COLOR_BIT;
  return (hasDepth() ? VK_IMAGE_ASPECT_DEPTH_BIT : 0) | (hasStencil() ? VK_IMAGE_ASPECT_STENCIL_BIT : 0);
}

const FormatInfo* formatInfo(VkFormat format) {
  size_t index = size_t(format) - 1;
  if (index < kDense) return &kFormats[index];
  for (size_t i = kDense; i < std::size(kFormats); ++i)
    if (kFormats[i].format == format) return &kFormats[i];
  return nullptr;
}

std::span<const FormatInfo> allFormats() { return kFormats; }

uint16_t formatKey(const FormatInfo& f) { return uint16_t(&f - kFormats + 1); }

VkFormatFeatureFlags2 optimalFeatures(const FormatInfo& f) {
  if (f.isDepthStencil()) {
    // D16_UNORM_S8_UINT would be one more layout for nothing: not required, not used.
    if (f.format == VK_FORMAT_D16_UNORM_S8_UINT) return 0;
    VkFormatFeatureFlags2 features = kTransfer | VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_BIT | VK_FORMAT_FEATURE_2_BLIT_SRC_BIT |
                                     VK_FORMAT_FEATURE_2_BLIT_DST_BIT | VK_FORMAT_FEATURE_2_DEPTH_STENCIL_ATTACHMENT_BIT;
    if (f.hasDepth()) features |= kLinearFilter | VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_DEPTH_COMPARISON_BIT;
    return features;
  }
  VkFormatFeatureFlags2 features = colorImageFeatures(f);
  if (f.isCompressed() || f.isMultiPlanar() || isScaled(f) || isWide(f)) return features;
  if (powerOfTwo(f.elementBytes) && !(f.flags & kSharedExponent)) {
    features |= VK_FORMAT_FEATURE_2_COLOR_ATTACHMENT_BIT;
    if (!f.isInteger()) features |= VK_FORMAT_FEATURE_2_COLOR_ATTACHMENT_BLEND_BIT;
  }
  if (storable(f)) {
    features |= VK_FORMAT_FEATURE_2_STORAGE_IMAGE_BIT | VK_FORMAT_FEATURE_2_STORAGE_READ_WITHOUT_FORMAT_BIT |
                VK_FORMAT_FEATURE_2_STORAGE_WRITE_WITHOUT_FORMAT_BIT;
    if (isWord(f)) features |= VK_FORMAT_FEATURE_2_STORAGE_IMAGE_ATOMIC_BIT;
  }
  return features;
}

VkFormatFeatureFlags2 linearFeatures(const FormatInfo& f) { return f.isDepthStencil() ? 0 : colorImageFeatures(f); }

VkFormatFeatureFlags2 bufferFeatures(const FormatInfo& f) {
  if (isWide(f)) return VK_FORMAT_FEATURE_2_VERTEX_BUFFER_BIT;
  if (f.isCompressed() || f.isDepthStencil() || f.isMultiPlanar() || (f.flags & kPadded16) || isSrgb(f)) return 0;
  VkFormatFeatureFlags2 features = 0;
  if (!(f.flags & kSharedExponent)) features |= VK_FORMAT_FEATURE_2_VERTEX_BUFFER_BIT;
  if (!isScaled(f)) features |= VK_FORMAT_FEATURE_2_UNIFORM_TEXEL_BUFFER_BIT;
  if (storable(f)) {
    features |= VK_FORMAT_FEATURE_2_STORAGE_TEXEL_BUFFER_BIT | VK_FORMAT_FEATURE_2_STORAGE_READ_WITHOUT_FORMAT_BIT |
                VK_FORMAT_FEATURE_2_STORAGE_WRITE_WITHOUT_FORMAT_BIT;
    if (isWord(f)) features |= VK_FORMAT_FEATURE_2_STORAGE_TEXEL_BUFFER_ATOMIC_BIT;
  }
  return features;
}

VkSampleCountFlags sampleCounts(const FormatInfo& f) {
  constexpr VkFormatFeatureFlags2 kAttachment = VK_FORMAT_FEATURE_2_COLOR_ATTACHMENT_BIT | VK_FORMAT_FEATURE_2_DEPTH_STENCIL_ATTACHMENT_BIT;
  return optimalFeatures(f) & kAttachment ? kSampleCounts : VkSampleCountFlags(VK_SAMPLE_COUNT_1_BIT);
}

bool compatible(const FormatInfo& a, const FormatInfo& b) {
  if (&a == &b) return true;
  if (a.isDepthStencil() || b.isDepthStencil()) return false;  // each is a class of its own
  if (a.isMultiPlanar() || b.isMultiPlanar()) return false;
  return a.elementBytes == b.elementBytes && a.isCompressed() == b.isCompressed();
}

}  // namespace pumice::texture
