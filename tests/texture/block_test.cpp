// Block-compressed texels against a second decoder written from the specification.
#include <gtest/gtest.h>

#include <random>

#include "tests/texture/block_reference.h"
#include "tests/texture/run_ir.h"
#include "texture/block.h"
#include "texture/pack.h"

namespace pumice::texture {
namespace {

using ir::Type;
using ir::Value;

// Random blocks in which every mode and every special case of endpoints occurs.
std::vector<reference::Block> blocksFor(const FormatInfo& f, uint32_t count) {
  std::mt19937 random(uint32_t(f.format));
  std::vector<reference::Block> blocks(count);
  for (uint32_t i = 0; i < count; ++i) {
    reference::Block& k = blocks[i];
    for (uint8_t& v : k.bytes) v = uint8_t(random());
    if (f.compression == Compression::Bc7) {
      unsigned m = i % 9;
      k.bytes[0] = m == 8 ? 0 : uint8_t((k.bytes[0] | 1) << m);
      if (m < 8) k.set(m + 1, 6, i / 9);  // every partition
    } else if (f.compression == Compression::Bc6h) {
      k.set(0, 5, i % 32);
      if (i % 32 % 4 != 3) k.set(77, 5, i / 32);
    } else if (i % 16 == 0) {
      k.set(8, 8, k.bits(0, 8));  // equal endpoints
    } else if (i % 16 == 1) {
      k.set(0, 8, 0x80), k.set(8, 8, 0x81);  // the two codes of -1
    } else if (i % 16 == 2) {
      k.set(0, 8, 0x7f), k.set(8, 8, 0x80);
    }
  }
  return blocks;
}

class BlockTexels : public testing::TestWithParam<VkFormat> {};

TEST_P(BlockTexels, EqualTheSpecification) {
  const FormatInfo& f = *formatInfo(GetParam());
  ASSERT_TRUE(f.isCompressed());
  constexpr uint32_t kCount = 4608;  // 512 of each mode of BC7, 144 of each name of BC6H
  std::vector<reference::Block> blocks = blocksFor(f, kCount);
  std::vector<uint8_t> memory(kCount * f.elementBytes);
  for (uint32_t i = 0; i < kCount; ++i) std::memcpy(memory.data() + i * f.elementBytes, blocks[i].bytes.data(), f.elementBytes);
  IrProgram program(3, 4, [&](ir::Builder& b) {
    Value offset = b.imul(b.input(Type::I32, 0), b.i32(f.elementBytes));
    Texel t = loadBlockTexel(b, f, b.i64(uint64_t(memory.data())), offset, b.i64(memory.size()), true, b.input(Type::I32, 1), b.input(Type::I32, 2));
    for (uint32_t c = 0; c < 4; ++c) b.output(c, t[c]);
  });
  ASSERT_TRUE(program);
  std::vector<std::vector<uint32_t>> in(3);
  for (uint32_t i = 0; i < kCount * 16; ++i) {
    in[0].push_back(i / 16);
    in[1].push_back(i % 4);
    in[2].push_back(i / 4 % 4);
  }
  auto out = program.run(in);
  int wrong = 0;
  for (uint32_t i = 0; i < kCount * 16 && wrong < 5; ++i) {
    reference::Rgba expected = reference::decode(f, blocks[i / 16], i % 16);
    for (int c = 0; c < 4; ++c) {
      float got = std::bit_cast<float>(out[c][i]);
      // The reference's own double rounding aside, the result is the correctly rounded one.
      double ulp = std::abs(expected[c]) * 0x1p-24 * 1.001 + 1e-15;
      bool same = std::isinf(expected[c]) ? got == expected[c] : std::abs(got - expected[c]) <= ulp;
      if (same) continue;
      ++wrong;
      ADD_FAILURE() << f.name << " block " << i / 16 << " (first byte " << int(blocks[i / 16].bytes[0]) << ") texel " << i % 16 << " component " << c << ": "
                    << got << ", the specification says " << expected[c];
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Texture, BlockTexels,
                         testing::Values(VK_FORMAT_BC1_RGB_UNORM_BLOCK, VK_FORMAT_BC1_RGB_SRGB_BLOCK, VK_FORMAT_BC1_RGBA_UNORM_BLOCK,
                                         VK_FORMAT_BC1_RGBA_SRGB_BLOCK, VK_FORMAT_BC2_UNORM_BLOCK, VK_FORMAT_BC2_SRGB_BLOCK, VK_FORMAT_BC3_UNORM_BLOCK,
                                         VK_FORMAT_BC3_SRGB_BLOCK, VK_FORMAT_BC4_UNORM_BLOCK, VK_FORMAT_BC4_SNORM_BLOCK, VK_FORMAT_BC5_UNORM_BLOCK,
                                         VK_FORMAT_BC5_SNORM_BLOCK, VK_FORMAT_BC6H_UFLOAT_BLOCK, VK_FORMAT_BC6H_SFLOAT_BLOCK, VK_FORMAT_BC7_UNORM_BLOCK,
                                         VK_FORMAT_BC7_SRGB_BLOCK),
                         [](const auto& info) { return std::string(formatInfo(info.param)->name); });

// The divisors of interpolated components are no powers of two less one: every numerator is tried.
TEST(BlockTexels, QuotientsAreCorrectlyRounded) {
  for (uint32_t divisor : {15u, 186u, 255u, 378u, 127u * 35, 255u * 35}) {
    IrProgram program(1, 1, [&](ir::Builder& b) { b.output(0, divideExact(b, b.convert(ir::Op::SToF, Type::F32, b.input(Type::I32, 0)), divisor)); });
    ASSERT_TRUE(program);
    std::vector<std::vector<uint32_t>> in(1);
    for (uint32_t v = 0; v <= divisor; ++v) in[0].push_back(v);
    auto out = program.run(in);
    for (uint32_t v = 0; v <= divisor; ++v) ASSERT_EQ(std::bit_cast<float>(out[0][v]), float(double(v) / divisor)) << v << " / " << divisor;
  }
}

TEST(BlockTexels, OutsideTheMemoryBitsAreZero) {
  const FormatInfo& f = *formatInfo(VK_FORMAT_BC7_UNORM_BLOCK);
  std::vector<uint8_t> memory(32, 0xff);
  IrProgram program(1, 4, [&](ir::Builder& b) {
    Texel t = loadBlockTexel(b, f, b.i64(uint64_t(memory.data())), b.input(Type::I32, 0), b.i64(16), true, b.i32(1), b.i32(2));
    for (uint32_t c = 0; c < 4; ++c) b.output(c, t[c]);
  });
  auto out = program.run({{0, 16}});
  EXPECT_NE(out[0][0], 0u);
  for (int c = 0; c < 4; ++c) EXPECT_EQ(out[c][1], 0u);
}

}  // namespace
}  // namespace pumice::texture
