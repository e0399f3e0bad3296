// Subgroup operations against their definitions: whole and broken subgroups, with lanes switched off.
#include <gtest/gtest.h>

#include <bit>
#include <functional>

#include "tests/frontend/compile.h"
#include "tests/frontend/run_compute.h"

namespace pumice::frontend {
namespace {

using test::Buffers;

constexpr uint32_t kLanes = 50;  // one full subgroup and one of 18 lanes
constexpr uint32_t kWords = 16;

uint32_t input(uint32_t lane) { return lane * 2654435761u; }

//! Lanes that run the code under test: a pattern with holes, the first lane of the second subgroup among them.
bool isActive(uint32_t lane) { return lane % 5 != 2; }

//! Runs `body` (which sets r(0), r(1), ...) in the active lanes; gives [lane][word].
std::vector<std::vector<uint32_t>> results(const std::string& body, const std::string& helpers = "") {
  Buffers b(2);
  for (uint32_t l = 0; l < kLanes; l++) b[0].push_back(input(l));
  b[1].assign(kLanes * kWords, 0xdeadbeef);
  test::runGlsl(R"(
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_shuffle_relative : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_clustered : require
#extension GL_KHR_shader_subgroup_quad : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_shader_subgroup_extended_types_int8 : require
#extension GL_EXT_shader_subgroup_extended_types_int16 : require
#extension GL_EXT_shader_subgroup_extended_types_int64 : require
#extension GL_EXT_shader_subgroup_extended_types_float16 : require
layout(local_size_x=50) in;
layout(std430, binding=0) buffer A { uint a[]; };
layout(std430, binding=1) buffer R { uint data[]; };
#define r(k) data[i * 16 + k]
)" + helpers + R"(
void main() {
  uint i = gl_LocalInvocationIndex, x = a[i];
  if (i % 5 != 2) {
)" + body + "}\n}\n", 1, b);
  std::vector<std::vector<uint32_t>> out;
  for (uint32_t l = 0; l < kLanes; l++)
    out.emplace_back(b[1].begin() + l * kWords, b[1].begin() + (l + 1) * kWords);
  return out;
}

uint32_t firstOf(uint32_t lane) { return lane / 32 * 32; }
uint32_t endOf(uint32_t lane) { return std::min(firstOf(lane) + 32, kLanes); }
uint32_t ballotOf(uint32_t lane, const std::function<bool(uint32_t)>& f) {
  uint32_t bits = 0;
  for (uint32_t l = firstOf(lane); l < endOf(lane); l++)
    if (isActive(l) && f(l)) bits |= 1u << l % 32;
  return bits;
}

TEST(Subgroup, BuiltIns) {
  auto r = results(R"(
r(0) = gl_SubgroupSize; r(1) = gl_NumSubgroups; r(2) = gl_SubgroupID; r(3) = gl_SubgroupInvocationID;
r(4) = gl_SubgroupEqMask.x; r(5) = gl_SubgroupGeMask.x; r(6) = gl_SubgroupGtMask.x; r(7) = gl_SubgroupLeMask.x;
r(8) = gl_SubgroupLtMask.x; r(9) = gl_SubgroupGeMask.y | gl_SubgroupEqMask.w; r(10) = uint(subgroupElect());
subgroupBarrier(); subgroupMemoryBarrier();
)");
  for (uint32_t l = 0; l < kLanes; l++) {
    if (!isActive(l)) {
      EXPECT_EQ(r[l][0], 0xdeadbeef);
      continue;
    }
    uint32_t lane = l % 32, bit = 1u << lane;
    EXPECT_EQ(r[l][0], 32u);
    EXPECT_EQ(r[l][1], 2u);
    EXPECT_EQ(r[l][2], l / 32);
    EXPECT_EQ(r[l][3], lane);
    EXPECT_EQ(r[l][4], bit);
    EXPECT_EQ(r[l][5], ~(bit - 1));
    EXPECT_EQ(r[l][6], ~(bit - 1) & ~bit);
    EXPECT_EQ(r[l][7], (bit - 1) | bit);
    EXPECT_EQ(r[l][8], bit - 1);
    EXPECT_EQ(r[l][9], 0u);
    EXPECT_EQ(r[l][10], l == 0 || l == 33) << "lane 32 is inactive";
  }
}

TEST(Subgroup, VotesAndBallots) {
  auto r = results(R"(
r(0) = uint(subgroupAll(x != 0 || i == 0)); r(1) = uint(subgroupAny(i == 40)); r(2) = uint(subgroupAllEqual(i / 32));
r(3) = uint(subgroupAllEqual(vec2(i / 32, i / 31))); r(4) = uint(subgroupAllEqual(i > 20));
uvec4 b = subgroupBallot((x & 0x100u) != 0);
r(5) = b.x; r(6) = b.y | b.z | b.w; r(7) = uint(subgroupInverseBallot(b)); r(8) = uint(subgroupBallotBitExtract(b, i % 32));
r(9) = subgroupBallotBitCount(b); r(10) = subgroupBallotInclusiveBitCount(b); r(11) = subgroupBallotExclusiveBitCount(b);
r(12) = subgroupBallotFindLSB(b); r(13) = subgroupBallotFindMSB(b);
r(14) = subgroupBroadcastFirst(x); r(15) = subgroupBroadcast(x, 4);
)");
  for (uint32_t l = 0; l < kLanes; l++) {
    if (!isActive(l)) continue;
    uint32_t b = ballotOf(l, [](uint32_t k) { return (input(k) & 0x100) != 0; }), lane = l % 32;
    EXPECT_EQ(r[l][0], 1u);
    EXPECT_EQ(r[l][1], l / 32);
    EXPECT_EQ(r[l][2], 1u);
    EXPECT_EQ(r[l][3], l / 32);
    EXPECT_EQ(r[l][4], l / 32);
    EXPECT_EQ(r[l][5], b);
    EXPECT_EQ(r[l][6], 0u);
    EXPECT_EQ(r[l][7], b >> lane & 1);
    EXPECT_EQ(r[l][8], b >> lane & 1);
    EXPECT_EQ(r[l][9], uint32_t(std::popcount(b)));
    EXPECT_EQ(r[l][10], uint32_t(std::popcount(b & ((2u << lane) - 1))));
    EXPECT_EQ(r[l][11], uint32_t(std::popcount(b & ((1u << lane) - 1))));
    EXPECT_EQ(r[l][12], uint32_t(std::countr_zero(b)));
    EXPECT_EQ(r[l][13], 31u - uint32_t(std::countl_zero(b)));
    EXPECT_EQ(r[l][14], input(l < 32 ? 0 : 33));
    EXPECT_EQ(r[l][15], input(firstOf(l) + 4));
  }
}

TEST(Subgroup, Shuffles) {
  auto r = results(R"(
uint lane = gl_SubgroupInvocationID;
r(0) = subgroupShuffle(x, (lane * 7u + 3u) & 15u); r(1) = subgroupShuffleXor(x, 5); r(2) = subgroupShuffleUp(x, 3);
r(3) = subgroupShuffleDown(x, 4); r(4) = uint(subgroupShuffle((x & 1u) != 0, lane ^ 1u));
r(5) = uint(subgroupShuffleXor(float16_t(lane), 1)); r(6) = uint(subgroupShuffleXor(uint64_t(lane) << 33, 1) >> 33);
r(7) = uint(subgroupShuffleXor(uint8_t(lane), 1)); r(8) = uint(subgroupShuffleXor(ivec3(1, lane, 2), 1).y);
)");
  for (uint32_t l = 0; l < kLanes; l++) {
    if (!isActive(l)) continue;
    uint32_t lane = l % 32;
    auto expect = [&](int word, uint32_t from, auto value) {
      uint32_t at = firstOf(l) + from;
      if (from < 32 && at < kLanes && isActive(at)) {
        EXPECT_EQ(r[l][size_t(word)], value(at)) << "lane " << l << " word " << word;
      }
    };
    expect(0, (lane * 7 + 3) & 15, input);
    expect(1, lane ^ 5, input);
    if (lane >= 3) expect(2, lane - 3, input);
    expect(3, lane + 4, input);
    expect(4, lane ^ 1, [](uint32_t at) { return input(at) & 1; });
    for (int word : {5, 6, 7, 8}) expect(word, lane ^ 1, [](uint32_t at) { return at % 32; });
  }
}

TEST(Subgroup, Quads) {
  auto r = results(R"(
r(0) = subgroupQuadBroadcast(x, 3); r(1) = subgroupQuadSwapHorizontal(x); r(2) = subgroupQuadSwapVertical(x);
r(3) = subgroupQuadSwapDiagonal(x); r(4) = uint(subgroupQuadSwapHorizontal((x & 1u) != 0));
r(5) = uint(subgroupQuadBroadcast(vec2(i, i + 1), 1).y);
)");
  for (uint32_t l = 0; l < kLanes; l++) {
    if (!isActive(l)) continue;
    auto expect = [&](int word, uint32_t at, uint32_t value) {
      if (at < kLanes && isActive(at)) {
        EXPECT_EQ(r[l][size_t(word)], value) << "lane " << l << " word " << word;
      }
    };
    expect(0, l | 3, input(l | 3));
    expect(1, l ^ 1, input(l ^ 1));
    expect(2, l ^ 2, input(l ^ 2));
    expect(3, l ^ 3, input(l ^ 3));
    expect(4, l ^ 1, input(l ^ 1) & 1);
    expect(5, (l & ~3u) | 1, ((l & ~3u) | 1) + 1);
  }
}

//! Sums and such over the active lanes from `first` to `end`.
template <typename T, typename F>
T fold(uint32_t first, uint32_t end, T start, F f) {
  for (uint32_t l = first; l < std::min(end, kLanes); l++)
    if (isActive(l)) start = f(start, l);
  return start;
}

TEST(Subgroup, Arithmetic) {
  auto r = results(R"(
r(0) = subgroupAdd(x); r(1) = subgroupInclusiveAdd(x); r(2) = subgroupExclusiveAdd(x); r(3) = subgroupClusteredAdd(x, 8);
r(4) = subgroupMul(x | 1u); r(5) = subgroupMin(x); r(6) = subgroupMax(x); r(7) = uint(subgroupMin(int(x)));
r(8) = uint(subgroupInclusiveMax(int(x))); r(9) = subgroupAnd(x | 0xffu); r(10) = subgroupOr(x & 0xff00ff00u);
r(11) = subgroupExclusiveXor(x); r(12) = uint(subgroupAnd((x & 0x80000001u) != 0)) | uint(subgroupOr(i == 49)) << 1;
r(13) = uint(subgroupInclusiveXor((x & 1u) != 0)); r(14) = subgroupClusteredMin(x, 1); r(15) = subgroupClusteredMax(x, 32);
)");
  for (uint32_t l = 0; l < kLanes; l++) {
    if (!isActive(l)) continue;
    uint32_t f = firstOf(l), e = endOf(l);
    auto add = [](uint32_t s, uint32_t k) { return s + input(k); };
    EXPECT_EQ(r[l][0], fold(f, e, 0u, add));
    EXPECT_EQ(r[l][1], fold(f, l + 1, 0u, add));
    EXPECT_EQ(r[l][2], fold(f, l, 0u, add));
    EXPECT_EQ(r[l][3], fold(l & ~7u, (l & ~7u) + 8, 0u, add));
    EXPECT_EQ(r[l][4], fold(f, e, 1u, [](uint32_t s, uint32_t k) { return s * (input(k) | 1); }));
    EXPECT_EQ(r[l][5], fold(f, e, ~0u, [](uint32_t s, uint32_t k) { return std::min(s, input(k)); }));
    EXPECT_EQ(r[l][6], fold(f, e, 0u, [](uint32_t s, uint32_t k) { return std::max(s, input(k)); }));
    EXPECT_EQ(int(r[l][7]), fold(f, e, INT32_MAX, [](int s, uint32_t k) { return std::min(s, int(input(k))); }));
    EXPECT_EQ(int(r[l][8]), fold(f, l + 1, INT32_MIN, [](int s, uint32_t k) { return std::max(s, int(input(k))); }));
    EXPECT_EQ(r[l][9], fold(f, e, ~0u, [](uint32_t s, uint32_t k) { return s & (input(k) | 0xff); }));
    EXPECT_EQ(r[l][10], fold(f, e, 0u, [](uint32_t s, uint32_t k) { return s | (input(k) & 0xff00ff00u); }));
    EXPECT_EQ(r[l][11], fold(f, l, 0u, [](uint32_t s, uint32_t k) { return s ^ input(k); }));
    uint32_t all = fold(f, e, 1u, [](uint32_t s, uint32_t k) { return s & uint32_t((input(k) & 0x80000001) != 0); });
    EXPECT_EQ(r[l][12], all | (l / 32) << 1);
    EXPECT_EQ(r[l][13], fold(f, l + 1, 0u, [](uint32_t s, uint32_t k) { return s ^ (input(k) & 1); }));
    EXPECT_EQ(r[l][14], input(l));
    EXPECT_EQ(r[l][15], r[l][6]);
  }
}

TEST(Subgroup, ArithmeticOfOtherTypes) {
  auto r = results(R"(
uint lane = gl_SubgroupInvocationID;
r(0) = uint(subgroupAdd(float(lane))); r(1) = uint(subgroupInclusiveMin(float(50u - i))); r(2) = uint(subgroupMax(-vec2(lane, 1.0)).y + 2.0);
r(3) = uint(subgroupAdd(uint64_t(i) << 33) >> 33); r(4) = uint(subgroupAdd(uint8_t(x))); r(5) = uint(subgroupMax(int16_t(x)));
r(6) = uint(subgroupAdd(float16_t(lane & 7u))); r(7) = uint(subgroupAdd(double(i))); r(8) = uint(subgroupMul(float((i & 7u) == 0 ? 2 : 1)));
)");
  for (uint32_t l = 0; l < kLanes; l++) {
    if (!isActive(l)) continue;
    uint32_t f = firstOf(l), e = endOf(l);
    EXPECT_EQ(r[l][0], fold(f, e, 0u, [](uint32_t s, uint32_t k) { return s + k % 32; }));
    EXPECT_EQ(r[l][1], 50 - l);
    EXPECT_EQ(r[l][2], 1u);
    EXPECT_EQ(r[l][3], fold(f, e, 0u, [](uint32_t s, uint32_t k) { return s + k; }));
    EXPECT_EQ(r[l][4], fold(f, e, 0u, [](uint32_t s, uint32_t k) { return (s + input(k)) & 255; }));
    EXPECT_EQ(int(r[l][5]), fold(f, e, -32768, [](int s, uint32_t k) { return std::max(s, int(int16_t(input(k)))); }));
    EXPECT_EQ(r[l][6], fold(f, e, 0u, [](uint32_t s, uint32_t k) { return s + k % 8; }));
    EXPECT_EQ(r[l][7], fold(f, e, 0u, [](uint32_t s, uint32_t k) { return s + k; }));
    EXPECT_EQ(r[l][8], fold(f, e, 1u, [](uint32_t s, uint32_t k) { return s * (k % 8 == 0 ? 2 : 1); }));
  }
}

// Lanes that leave a loop early take no part any more; behind the loop all do again.
TEST(Subgroup, LoopsWithLanesThatLeave) {
  auto r = results(R"(
uint n = 0;
for (uint k = 0; k < 40; k++) {
  if (k >= (i & 7u)) break;
  n = n * 3u + subgroupAdd(1u);
}
r(0) = n; r(1) = subgroupAdd(1u);
switch (i & 3u) {
  case 0: r(2) = subgroupAdd(i); break;
  case 1: r(2) = subgroupAdd(1u);
  case 2: r(3) = subgroupAdd(1u); break;
  default: r(2) = subgroupBallot(true).x;
}
)");
  for (uint32_t l = 0; l < kLanes; l++) {
    if (!isActive(l)) continue;
    uint32_t f = firstOf(l), e = endOf(l), n = 0;
    auto count = [&](auto which) { return fold(f, e, 0u, [&](uint32_t s, uint32_t k) { return s + (which(k) ? 1 : 0); }); };
    for (uint32_t k = 0; k < (l & 7); k++) n = n * 3 + count([&](uint32_t m) { return (m & 7) > k; });
    EXPECT_EQ(r[l][0], n) << l;
    EXPECT_EQ(r[l][1], count([](uint32_t) { return true; }));
    switch (l & 3) {
      case 0: EXPECT_EQ(r[l][2], fold(f, e, 0u, [](uint32_t s, uint32_t k) { return s + (k & 3 ? 0 : k); })); break;
      case 1: EXPECT_EQ(r[l][2], count([](uint32_t k) { return (k & 3) == 1; })); [[fallthrough]];
      case 2: EXPECT_EQ(r[l][3], count([](uint32_t k) { return (k & 3) == 1 || (k & 3) == 2; })); break;
      default: EXPECT_EQ(r[l][2], ballotOf(l, [](uint32_t k) { return (k & 3) == 3; }));
    }
  }
}

// A module for devices of any subgroup size may hold clusters larger than ours, in code that it does not reach here.
TEST(Subgroup, ClustersLargerThanTheSubgroup) {
  auto r = results("r(0) = 1; if (gl_SubgroupSize >= 64) r(0) = subgroupClusteredAdd(x, 64u); r(1) = subgroupClusteredAdd(1u, 32u);");
  for (uint32_t l = 0; l < kLanes; l++) {
    if (!isActive(l)) continue;
    EXPECT_EQ(r[l][0], 1u);
    EXPECT_EQ(r[l][1], fold(firstOf(l), endOf(l), 0u, [](uint32_t s, uint32_t) { return s + 1; }));
  }
}

}  // namespace
}  // namespace pumice::frontend
