// The tables that routines read through ir::kTableConstants.
#include "texture/constants.h"

#include <bit>
#include <cmath>
#include <limits>

#include "texture/builders.h"

namespace pumice::texture {
namespace {

// The exact transfer function (Khronos Data Format Specification, "sRGB EOTF"), in extended precision.
long double decodeSrgb(long double s) { return s <= 0.04045L ? s / 12.92L : std::pow((s + 0.055L) / 1.055L, 2.4L); }

// The smallest f32 that encodes to code k or above: encode(c) * 255 >= k - 1/2.
float encodeThreshold(unsigned k) {
  long double exact = decodeSrgb((k - 0.5L) / 255.0L);
  float f = float(exact);
  return f < exact ? std::nextafter(f, 2.0f) : f;
}

SrgbTables makeTables() {
  SrgbTables t{};
  for (unsigned i = 0; i < 256; ++i) t.decode[i] = float(decodeSrgb(i / 255.0L));
  unsigned code = 0;
  for (unsigned i = 0; i < kSrgbBuckets; ++i) {
    // A bucket holds at most one threshold: `code` applies below it, code + 1 from it on.
    float first = std::bit_cast<float>(kSrgbFirstBits + (i << kSrgbShift));
    float last = std::bit_cast<float>(kSrgbFirstBits + ((i + 1) << kSrgbShift) - 1);
    while (code < 255 && encodeThreshold(code + 1) <= first) ++code;
    bool inside = code < 255 && encodeThreshold(code + 1) <= last;
    t.encode[i] = {code, inside ? encodeThreshold(code + 1) : std::numeric_limits<float>::infinity()};
  }
  return t;
}

}  // namespace

ConstantTable constantTable() {
  static const ConstantTables tables = {makeTables(), makeBlockTables(decodeSrgb)};
  return {reinterpret_cast<const std::byte*>(&tables), sizeof(tables)};
}

}  // namespace pumice::texture
