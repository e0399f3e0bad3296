#include "cts_subset/tests/families.h"

#include <algorithm>

namespace pumice::cts {
namespace {

constexpr double kNothingSaid = std::numeric_limits<double>::infinity();
constexpr bool kF = true;

// Of operations that the table gives in ULP.
template <int kTimes10>
double ulps(const Lane&, double v) { return kTimes10 / 10.0 * ulp(v); }
double division(const Lane& in, double v) {
  const double y = std::fabs(in.y);
  return y < 0x1p-126 || y > 0x1p126 || !std::isfinite(in.x) ? kNothingSaid : 2.5 * ulp(v);
}
double sumOfProducts(const Lane& in, double v) {
  return 3 * (ulp(double(in.x) * in.y) + ulp(double(in.y) * in.z) + ulp(double(in.z) * in.x)) + 3 * ulp(v);
}
double multiplyAdd(const Lane& in, double v) { return ulp(double(in.x) * in.y) + ulp(v); }
double sine(const Lane&, double) { return 0x1p-11; }
double tangent(const Lane&, double v) { return 0x1p-10 * (1 + v * v) * 2; }   // sin / cos, of -1 to 1
double exponential(const Lane& in, double v) { return (3 + 2 * std::min(std::fabs(double(in.x)), 90.0)) * ulp(v); }
double logarithm(const Lane& in, double v) {
  const double x = std::fabs(double(in.x)) + 1e-30;
  return x >= 0.5 && x <= 2 ? 0x1p-21 : 3 * ulp(v);
}
double power(const Lane& in, double v) {
  // exp2(y * log2(x)), with the error of the exponent
  const double e = std::clamp(double(in.y), -8.0, 8.0) * std::log2(std::min(std::fabs(double(in.x)), 100.0) + 0.01);
  return (3 + 2 * std::fabs(e)) * ulp(v) + std::fabs(v) * (8 * 0x1p-21 + 4 * ulp(e)) * 0.7;
}
double arc(const Lane&, double v) { return 4096 * ulp(v) + 0x1p-20; }
double hyperbolic(const Lane&, double v) { return 30 * ulp(std::fabs(v) + 1) + 16 * ulp(v); }   // from exp, of -8 to 8
double remainder(const Lane& in, double) {
  const double q = double(in.x) / in.y, near = std::fabs(q - std::nearbyint(q));
  if (!std::isfinite(q) || std::fabs(in.y) < 0x1p-126 || std::fabs(in.y) > 0x1p126 || near <= 8 * ulp(q)) return kNothingSaid;
  return 2 * ulp(double(in.y) * std::floor(q)) + ulp(in.x);
}
// Of what is made of a few dozen sums and products of values up to 10.
double geometry(const Lane&, double v) { return 1e-4 + 1e-4 * std::fabs(v); }
double packed(const Lane&, double) { return 1; }

bool hasSubgroups(const Device& d) {
  VkPhysicalDeviceVulkan11Properties v11{};
  v11.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES;
  VkPhysicalDeviceProperties2 p2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &v11, {}};
  vkGetPhysicalDeviceProperties2(d.physical, &p2);
  constexpr VkSubgroupFeatureFlags kUsed = VK_SUBGROUP_FEATURE_VOTE_BIT | VK_SUBGROUP_FEATURE_ARITHMETIC_BIT | VK_SUBGROUP_FEATURE_BALLOT_BIT |
                                           VK_SUBGROUP_FEATURE_SHUFFLE_BIT | VK_SUBGROUP_FEATURE_SHUFFLE_RELATIVE_BIT | VK_SUBGROUP_FEATURE_QUAD_BIT;
  return v11.subgroupSize >= 8 && v11.subgroupSize <= 32 && (v11.subgroupSupportedOperations & kUsed) == kUsed;
}

// Floats of moderate size from the integers.
const char* const kModerate = R"(
float m(uint v) { return float(int(v % 2001u) - 1000) / 100.0; }
vec4 mv(uint v, uint w) { return vec4(m(v), m(w), m(v >> 7), m(w >> 9)); }
mat3 mm(uint v, uint w) { return mat3(mv(v, w).xyz, mv(w >> 3, v >> 5).xyz, mv(v >> 11, w >> 2).yzw); }
mat4 mq(uint v, uint w) { return mat4(mv(v, w), mv(w >> 3, v >> 5), mv(v >> 11, w >> 2), mv(w >> 13, v >> 4)); }
)";

std::vector<InstructionFamily> make() {
  std::vector<InstructionFamily> f;
  f.push_back({"IntegerArithmetic", R"(
uint carry(uint a, uint b) { uint c; uint s = uaddCarry(a, b, c); return s * 2 + c; }
uint borrow(uint a, uint b) { uint c; uint s = usubBorrow(a, b, c); return s * 2 + c; }
uint wide(uint a, uint b, bool high) { uint h, l; umulExtended(a, b, h, l); return high ? h : l; }
int wideSigned(int a, int b, bool high) { int h, l; imulExtended(a, b, h, l); return high ? h : l; }
)", {{"a + b"}, {"a - b"}, {"a * b"}, {"a / max(b, 1u)"}, {"a % max(b, 1u)"}, {"a / 7u"}, {"a % 1000u"}, {"uint(i / (j == 0 || j == -1 ? 3 : j))"}, {"uint(i / -5)"},
     {"uint((i & 0x7fffffff) % max(j & 0x7fffffff, 1))"}, {"uint(-i)"}, {"uint(abs(i))"}, {"uint(sign(i))"}, {"min(a, b)"}, {"max(a, b)"}, {"uint(min(i, j))"}, {"uint(max(i, j))"},
     {"clamp(a, min(b, c), max(b, c))"}, {"uint(clamp(i, min(j, int(c)), max(j, int(c))))"}, {"carry(a, b)"}, {"borrow(a, b)"}, {"wide(a, b, true)"}, {"wide(a, b, false)"},
     {"uint(wideSigned(i, j, true))"}, {"uint(wideSigned(i, j, false))"}, {"a * 3u + b * 5u - c"}}});
  f.push_back({"Bits", "", {{"a << (b & 31u)"}, {"a >> (b & 31u)"}, {"uint(i >> (b & 31u))"}, {"a & b"}, {"a | b"}, {"a ^ b"}, {"~a"},
     {"bitfieldExtract(a, int(b % 32u), int(c % (33u - b % 32u)))"}, {"uint(bitfieldExtract(i, int(b % 32u), int(c % (33u - b % 32u))))"},
     {"bitfieldInsert(a, d, int(b % 32u), int(c % (33u - b % 32u)))"}, {"bitfieldReverse(a)"}, {"uint(bitCount(a))"}, {"uint(findLSB(a))"}, {"uint(findMSB(a))"}, {"uint(findMSB(i))"},
     {"uint(bitCount(i))"}, {"uint(findLSB(i & 0))"}, {"(a << 5) ^ (a >> 27)"}, {"a & -a"}}});
  f.push_back({"FloatArithmetic", "", {{"x + y", kF}, {"x - y", kF}, {"x * y", kF}, {"-x", kF}, {"x / y", kF, division}, {"x * y + z", kF, multiplyAdd}, {"fma(x, y, z)", kF, multiplyAdd},
     {"dot(vec3(x, y, z), vec3(y, z, x))", kF, sumOfProducts}, {"mod(x, y)", kF, remainder}, {"x * 0.5", kF}, {"x + 0.0", kF}, {"(x + 1.0) - 1.0", kF, [](const Lane& in, double) { return 2 * ulp(1 + std::fabs(double(in.x))); }},
     {"1.0 / y", kF, division}, {"vec4(x, y, z, w).w + vec2(x, y).y", kF}}});
  f.push_back({"Comparisons", "", {{"x < y ? 1u : 0u"}, {"x <= y ? 1u : 0u"}, {"x > y ? 1u : 0u"}, {"x >= y ? 1u : 0u"}, {"x == y ? 1u : 0u"}, {"x != y ? 1u : 0u"}, {"a < b ? 1u : 0u"}, {"a <= b ? 1u : 0u"},
     {"a > b ? 1u : 0u"}, {"a >= b ? 1u : 0u"}, {"a == b ? 1u : 0u"}, {"a != b ? 1u : 0u"}, {"i < j ? 1u : 0u"}, {"i <= j ? 1u : 0u"}, {"i > j ? 1u : 0u"}, {"i >= j ? 1u : 0u"},
     {"isinf(x) ? 1u : 0u"}, {"isnan(uintBitsToFloat(a)) ? 1u : 0u"}, {"any(lessThan(uvec3(a, b, c), uvec3(b, c, d))) ? 1u : 0u"}, {"all(greaterThan(vec2(x, y), vec2(y, z))) ? 1u : 0u"},
     {"(x < y) != (a < b) ? 1u : 0u"}, {"(x < y && a < b) || !(c < d) ? 1u : 0u"}, {"uint(dot(vec3(equal(ivec3(i, j, 0), ivec3(j, i, 0))), vec3(1, 2, 4)))"},
     {"mix(a, b, x < y)"}, {"mix(x, y, a < b)", kF}}});
  f.push_back({"Conversions", "", {{"float(i)", kF}, {"float(a)", kF, ulps<10>}, {"uint(int(clamp(x, -2e9, 2e9)))"}, {"uint(clamp(x, 0.0, 4e9))"}, {"floatBitsToUint(x)"}, {"uint(floatBitsToInt(y))"}, {"uintBitsToFloat((a & 0x3fffffu) | 0x3f800000u)", kF},
     {"uint(x < y)"}, {"uint(bool(a & 4u))"}, {"float(bool(a & 8u))", kF}, {"unpackHalf2x16(a & 0xbfffbfffu).x", kF, [](const Lane&, double) { return 0x1p-14; }}, {"unpackHalf2x16(a & 0xbfffbfffu).y", kF, [](const Lane&, double) { return 0x1p-14; }},
     {"unpackUnorm4x8(a).z", kF, ulps<25>}, {"unpackSnorm4x8(a).w", kF, ulps<25>}, {"unpackUnorm2x16(a).y", kF, ulps<25>}, {"unpackSnorm2x16(a).x", kF, ulps<25>},
     {"float(packUnorm4x8(vec4(x, y, z, w)) & 255u)", kF, packed}, {"float(packUnorm4x8(vec4(x, y, z, w)) >> 24)", kF, packed}, {"float(int(packSnorm4x8(vec4(x, y, z, w)) << 24) >> 24)", kF, packed},
     {"float(packUnorm2x16(vec2(x, y)) >> 16)", kF, packed}, {"float(int(packSnorm2x16(vec2(x, y)) << 16) >> 16)", kF, packed}, {"unpackHalf2x16(packHalf2x16(clamp(vec2(x, y), -60000.0, 60000.0))).x", kF, [](const Lane& in, double) { return std::ldexp(1.0, std::max(std::ilogb(std::clamp(in.x, -60000.f, 60000.f)), -14) - 10); }}}});
  f.push_back({"Glsl450", std::string(kModerate) + R"(
float fr(float x, bool power) { int e; float s = frexp(x, e); return power ? float(e) : s; }
float md(float x, bool whole) { float w; float f = modf(x, w); return whole ? w : f; }
)", {{"roundEven(x)", kF}, {"trunc(x)", kF}, {"floor(x)", kF}, {"ceil(x)", kF}, {"abs(x)", kF}, {"sign(x)", kF}, {"fract(clamp(x, -1e6, 1e6))", kF}, {"round(floor(m(a)) + 0.25)", kF}, {"min(x, y)", kF}, {"max(x, y)", kF},
     {"clamp(x, min(y, z), max(y, z))", kF}, {"step(x, y)", kF}, {"mix(m(a), m(b), 0.25)", kF, [](const Lane&, double) { return 1e-5; }}, {"smoothstep(-3.0, 5.0, m(a))", kF, [](const Lane&, double) { return 1e-6; }},
     {"sqrt(abs(x))", kF, ulps<50>}, {"inversesqrt(abs(x) + 1e-30)", kF, ulps<20>}, {"exp2(clamp(x, -90.0, 90.0))", kF, exponential}, {"exp(clamp(x, -80.0, 80.0))", kF, exponential}, {"log2(abs(x) + 1e-30)", kF, logarithm}, {"log(abs(x) + 1e-30)", kF, logarithm},
     {"pow(min(abs(x), 100.0) + 0.01, clamp(y, -8.0, 8.0))", kF, power}, {"sin(clamp(x, -3.14159, 3.14159))", kF, sine}, {"cos(clamp(x, -3.14159, 3.14159))", kF, sine}, {"tan(clamp(x, -1.0, 1.0))", kF, tangent},
     {"asin(clamp(x, -0.999, 0.999))", kF, arc}, {"acos(clamp(x, -0.999, 0.999))", kF, arc}, {"atan(x)", kF, arc}, {"atan(m(a), m(b) + 0.001)", kF, arc}, {"sinh(clamp(x, -8.0, 8.0))", kF, hyperbolic}, {"cosh(clamp(x, -8.0, 8.0))", kF, hyperbolic},
     {"tanh(clamp(x, -8.0, 8.0))", kF, hyperbolic}, {"asinh(clamp(x, -8.0, 8.0))", kF, arc}, {"acosh(1.0 + abs(m(a)))", kF, arc}, {"atanh(clamp(x, -0.9, 0.9))", kF, arc}, {"radians(m(a))", kF, ulps<25>}, {"degrees(m(a))", kF, ulps<25>},
     {"ldexp(m(a), int(b % 40u) - 20)", kF}, {"fr(m(a), false)", kF}, {"fr(m(a), true)", kF}, {"md(m(a), false)", kF}, {"md(m(a), true)", kF},
     {"length(mv(a, b))", kF, geometry}, {"distance(mv(a, b), mv(c, d))", kF, geometry}, {"cross(mv(a, b).xyz, mv(c, d).xyz).y", kF, geometry}, {"normalize(mv(a, b) + 0.005).z", kF, geometry},
     {"faceforward(mv(a, b), mv(b, c), mv(c, d) + 0.005).x", kF, [](const Lane&, double) { return kNothingSaid; }}, {"reflect(mv(a, b).xy, vec2(0.6, 0.8)).y", kF, geometry}, {"refract(normalize(mv(a, b).xy + 0.005), vec2(0.6, 0.8), 0.5).x", kF, geometry}}});
  f.push_back({"CompositesAndMatrices", std::string(kModerate) + R"(
struct S { uint u; vec3 v; uint w[3]; };
uint members(uint a, uint b) { S s[2]; s[0] = S(a, vec3(1), uint[3](a, b, a ^ b)); s[1] = S(b, vec3(2), uint[3](b, 7, a)); return s[a & 1].u + s[b & 1].w[a % 3] * 3 + uint(s[(a >> 1) & 1].v[b % 3]); }
uint shuffled(uvec4 v) { uvec4 t = v.wzyx; t.xz = t.zx; t[v.x & 3] += 5; return t.x + t.y * 3 + t.z * 5 + t.w * 7 + v[v.y & 3]; }
uint local(uint a, uint b) { uint t[16]; for (uint k = 0; k < 16; k++) t[k] = a * k + b; t[b % 16] = 1; uint s = 0; for (uint k = 0; k < 16; k++) s = s * 3 + t[(a + k) % 16]; return s; }
float column(mat4 m, uint k) { m[k % 4][k / 4 % 4] = 3.0; return m[(k + 1) % 4][k % 4] + m[k % 4][k / 4 % 4]; }
uint copied(uint a) { uint t[4] = uint[4](a, a + 1, a + 2, a + 3); uint u[4] = t; t[1] = 9; return u[1] * t[1] + u[a & 3]; }
)", {{"members(a, b)"}, {"shuffled(uvec4(a, b, c, d))"}, {"local(a, b)"}, {"copied(a)"}, {"column(mq(a, b), c)", kF}, {"(mm(a, b) * mm(c, d))[1][2]", kF, geometry}, {"(mm(a, b) * mv(c, d).xyz).y", kF, geometry}, {"(mv(c, d).xyz * mm(a, b)).z", kF, geometry},
     {"transpose(mq(a, b))[1][3]", kF}, {"outerProduct(mv(a, b).xy, mv(c, d).xyz)[2][1]", kF}, {"determinant(mm(a, b)) * 0.001", kF, geometry}, {"(inverse(mat2(3.0, m(a) * 0.1, m(b) * 0.1, 4.0)))[1][0]", kF, geometry}, {"(mq(a, b) * 2.0)[3][3]", kF},
     {"matrixCompMult(mq(a, b), mq(c, d))[2][1]", kF}, {"(mq(a, b) + mq(c, d))[0][1]", kF}}});
  f.push_back({"ControlFlow", R"(
uint collatz(uint v) { uint steps = 0; v = v % 1000u + 1u; while (v != 1u && steps < 300u) { v = (v & 1u) != 0u ? 3u * v + 1u : v / 2u; steps++; } return steps; }
uint nested(uint a, uint b) { uint s = 0; for (uint i = 0; i < a % 9u; i++) { if (i == b % 5u) continue; for (uint j = 0; ; j++) { if (j > i + b % 3u) break; if ((i ^ j) % 4u == 3u) return s * 31u + j; s += i * j + 1u; } } return s; }
uint fallThrough(uint a) { uint s = 1; switch (a % 7u) { case 0u: s += 5u; case 1u: s *= 3u; break; case 2u: return 77u; case 3u: s += 2u; case 4u: case 5u: s *= 7u; default: s += 1000u; } return s; }
uint inLoop(uint a) { uint s = 0; for (uint i = 0; i < 12u; i++) { switch ((a >> i) & 3u) { case 0u: continue; case 1u: s += i; break; case 2u: if (s > 20u) return s; s += 10u; default: s ^= 0x55u; } s = s * 2u + 1u; } return s; }
uint turned(uint a) { uint s = 0, k = 0; do { s += k * a; if (s > 0x80000000u) break; k++; } while (k < (a & 15u)); return s + k; }
void twice(inout uint v, out uint w) { v *= 2u; w = v + 1u; if (v > 100u) return; v += 3u; }
uint called(uint a) { uint w; uint v = a % 200u; twice(v, w); twice(v, w); return v * 1000u + w; }
)", {{"collatz(a)"}, {"nested(a, b)"}, {"fallThrough(a)"}, {"inLoop(a)"}, {"turned(a)"}, {"called(a)"}, {"a < b ? (c < d ? 1u : 2u) : (a < d ? collatz(c) : 4u)"}}});
  f.push_back({"Atomics", R"(
shared uint s;
shared int t;
#define ATOMIC(name, start, call) uint name(uint a, uint n) { if (n % 64u == 0u) s = start; barrier(); call; barrier(); uint r = s; barrier(); return r; }
ATOMIC(add, 5u, atomicAdd(s, a))
ATOMIC(low, ~0u, atomicMin(s, a))
ATOMIC(high, 0u, atomicMax(s, a))
ATOMIC(both, ~0u, atomicAnd(s, a | 0xffff0000u))
ATOMIC(either, 0u, atomicOr(s, a & 0xffffu))
ATOMIC(differing, 9u, atomicXor(s, a))
ATOMIC(exchanged, 9u, if (n % 64u == 17u) atomicExchange(s, a))
ATOMIC(swapped, 9u, if (n % 64u == 3u) atomicCompSwap(s, 9u, a); if (n % 64u == 5u) atomicCompSwap(s, 0x12345u, 0u))
uint lowSigned(int a, uint n) { if (n % 64u == 0u) t = 0x7fffffff; barrier(); atomicMin(t, a); barrier(); uint r = uint(t); barrier(); return r; }
uint highSigned(int a, uint n) { if (n % 64u == 0u) t = -0x7fffffff; barrier(); atomicMax(t, a); barrier(); uint r = uint(t); barrier(); return r; }
uint own(uint a, uint n) { uint k = n * 16u; scratch[k] = a; uint r = atomicAdd(scratch[k], 3u) * 3u; r += atomicXor(scratch[k], 0xffu) * 5u; r += atomicExchange(scratch[k], 8u); r += atomicCompSwap(scratch[k], 8u, 11u); r += atomicMax(scratch[k], 10u) * 7u; return r + scratch[k]; }
)", {{"add(a, n)"}, {"low(a, n)"}, {"high(a, n)"}, {"both(a, n)"}, {"either(a, n)"}, {"differing(a, n)"}, {"exchanged(a, n)"}, {"swapped(a, n)"}, {"lowSigned(i, n)"}, {"highSigned(i, n)"}, {"own(a, n)"}}});
  f.push_back({"SharedMemory", R"(
shared uint line[64];
shared vec4 rows[64];
shared struct { uint k; uint l[3]; } parts[64];
uint reversed(uint a, uint n) { uint l = n % 64u; line[l] = a; barrier(); uint r = line[63u - l]; barrier(); return r; }
uint scanned(uint a, uint n) { uint l = n % 64u; line[l] = a; barrier(); for (uint k = 1u; k < 64u; k *= 2u) { uint v = l >= k ? line[l - k] : 0u; barrier(); line[l] += v; barrier(); } uint r = line[l]; barrier(); return r; }
float gathered(vec4 v, uint a, uint n) { uint l = n % 64u; rows[l] = v; barrier(); float r = rows[a % 64u][a / 64u % 4u]; barrier(); return r; }
uint structured(uint a, uint b, uint n) { uint l = n % 64u; parts[l].k = a; parts[l].l[a % 3u] = b; parts[l].l[(a % 3u + 1u) % 3u] = 5u; parts[l].l[(a % 3u + 2u) % 3u] = 6u; barrier(); uint o = b % 64u; uint r = parts[o].k + parts[o].l[0] + parts[o].l[2] * 3u; barrier(); return r; }
)", {{"reversed(a, n)"}, {"scanned(a, n)"}, {"gathered(vec4(x, y, z, w), a, n)", kF}, {"structured(a, b, n)"}}});
  // Subgroups have different sizes: only what eight neighbours can say.
  f.push_back({"Subgroups", R"(
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_shuffle_relative : require
#extension GL_KHR_shader_subgroup_quad : require
uint base() { return gl_SubgroupInvocationID & ~7u; }
uint sum8(uint a) { uint before = subgroupExclusiveAdd(a), with = subgroupInclusiveAdd(a); return subgroupShuffle(with, base() + 7u) - subgroupShuffle(before, base()); }
uint xor8(uint a) { uint before = subgroupExclusiveXor(a), with = subgroupInclusiveXor(a); return subgroupShuffle(with, base() + 7u) ^ subgroupShuffle(before, base()); }
uint ballot8(bool p) { return (subgroupBallot(p).x >> base()) & 255u; }
uint divergent(uint a) { uint r = 1u; if ((a & 1u) != 0u) { r = (subgroupBallot(true).x >> base()) & 255u; r += subgroupInclusiveAdd(1u) - subgroupExclusiveAdd(1u); } return r; }
)", {{"sum8(a)"}, {"xor8(a)"}, {"ballot8(a < b)"}, {"divergent(a)"}, {"subgroupShuffle(a, gl_SubgroupInvocationID ^ 5u)"}, {"subgroupShuffleXor(a, 3u)"}, {"gl_SubgroupInvocationID % 8u < 7u ? subgroupShuffleDown(a, 1u) : 0u"},
     {"gl_SubgroupInvocationID % 8u > 1u ? subgroupShuffleUp(a, 2u) : 0u"}, {"subgroupQuadBroadcast(a, 2u)"}, {"subgroupQuadSwapHorizontal(a)"}, {"subgroupQuadSwapVertical(a)"}, {"subgroupQuadSwapDiagonal(a)"}, {"subgroupAll(n < 100000u) ? 1u : 0u"}, {"subgroupAny(n > 100000u) ? 1u : 0u"},
     {"subgroupAllEqual(7u) ? 1u : 0u"}, {"subgroupInclusiveMax(a) >= a ? 1u : 0u"}, {"subgroupMin(a) <= a ? 1u : 0u"}, {"subgroupBallotBitExtract(subgroupBallot(a < b), gl_SubgroupInvocationID) ? 1u : 0u"}, {"subgroupInverseBallot(subgroupBallot(a < c)) ? 1u : 0u"},
     {"subgroupBroadcastFirst(5u)"}, {"subgroupQuadBroadcast(x, 1u)", kF}, {"subgroupShuffleXor(vec2(x, y), 1u).y", kF}},
               hasSubgroups});
  f.push_back({"SmallAndWideIntegers", R"(
#extension GL_EXT_shader_explicit_arithmetic_types : require
#define FOLD64(v) (uint(v) ^ uint((v) >> 32) * 31u)
uint64_t u(uint a, uint b) { return uint64_t(a) << 32 | uint64_t(b); }
)", {{"FOLD64(u(a, b) + u(c, d))"}, {"FOLD64(u(a, b) - u(c, d))"}, {"FOLD64(u(a, b) * u(c, d))"}, {"FOLD64(u(a, b) / (u(c >> 20, d) | 1ul))"}, {"FOLD64(u(a, b) % (u(c >> 10, d) | 1ul))"}, {"FOLD64(u(a, b) << (c & 63u))"}, {"FOLD64(u(a, b) >> (c & 63u))"}, {"FOLD64(uint64_t(int64_t(u(a, b)) >> (c & 63u)))"},
     {"FOLD64(uint64_t(int64_t(u(a, b)) / (int64_t(c >> 1) + 2l)))"}, {"u(a, b) < u(c, d) ? 1u : 0u"}, {"int64_t(u(a, b)) < int64_t(u(c, d)) ? 1u : 0u"}, {"FOLD64(min(u(a, b), u(c, d)))"}, {"FOLD64(uint64_t(abs(int64_t(u(a, b)))))"}, {"FOLD64(u(a, b) & ~u(c, d))"},
     {"uint(uint16_t(a) + uint16_t(b))"}, {"uint(uint16_t(a) * uint16_t(b))"}, {"uint(int(int16_t(a) >> int16_t(b & 15u)))"}, {"uint(uint16_t(a) / (uint16_t(b) | 1us))"}, {"uint(int(int16_t(a) / (int16_t(b & 0xfffu) + 2s)))"}, {"int16_t(a) < int16_t(b) ? 1u : 0u"}, {"uint(max(uint16_t(a), uint16_t(b)))"},
     {"uint(uint8_t(a) + uint8_t(b))"}, {"uint(uint8_t(a) * uint8_t(b))"}, {"uint(int(int8_t(a) >> int8_t(b & 7u)))"}, {"uint(int(int8_t(a)))"}, {"int8_t(a) < int8_t(b) ? 1u : 0u"}, {"uint(uint8_t(a) / (uint8_t(b) | uint8_t(1)))"}, {"uint(u8vec4(a, b, c, d).z)"}, {"FOLD64(uint64_t(int64_t(int8_t(a))))"}},
               [](const Device& d) { return d.features.shaderInt64 && d.features.shaderInt16 && d.vulkan12.shaderInt8; }});
  f.push_back({"Doubles", R"(
uint fold(double v) { uvec2 u = unpackDouble2x32(v); return u.x ^ u.y * 31u; }
double of(uint a, uint b) { return double(int(a)) + double(b) / 1048576.0; }
)", {{"fold(of(a, b) + of(c, d))"}, {"fold(of(a, b) - of(c, d))"}, {"fold(of(a, b) * of(c, d))"}, {"fold(-of(a, b))"}, {"fold(abs(of(a, b)))"}, {"fold(floor(of(a, b)))"}, {"fold(double(x))"}, {"float(of(a, b))", kF}, {"uint(int(of(a, b) * 0.25))"}, {"of(a, b) < of(c, d) ? 1u : 0u"},
     {"fold(min(of(a, b), of(c, d)))"}, {"fold(packDouble2x32(uvec2(a, b & 0x3fffffffu)))"}, {"float(of(a, b) / (of(c, d) + 0.3LF))", kF, ulps<15>}, {"float(sqrt(abs(of(a, b))))", kF, ulps<15>}},
               [](const Device& d) { return bool(d.features.shaderFloat64); }});
  // (lavapipe 22.3 stores the first component of a vector into all of them, by an address.)
  f.push_back({"PointersAndAddresses", R"(
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
layout(buffer_reference, std430, buffer_reference_align = 4) buffer Word { uint v; };
layout(buffer_reference, std430, buffer_reference_align = 16) buffer Block { uint u; float f; uvec2 v; uint w[4]; };
uint through(uint a, uint n) { Word p = Word(address + uint64_t(n) * 64ul); p.v = a; p[1].v = a + 1u; p[5].v = a ^ 3u; return p[1].v * 3u + p.v + Word(uint64_t(p) + 20ul).v; }
uint structured(uint a, float x, uint n, uint part) { Block p = Block(address + uint64_t(n) * 64ul); p.u = a; p.f = x; p.v.x = a; p.v.y = 9u; p.w[a % 4u] = 5u; p.w[(a + 1u) % 4u] = a; return part == 0u ? p.u : part == 1u ? floatBitsToUint(p.f) : part == 2u ? p.v.x + p.v.y * 3u : p.w[a % 4u] + p.w[(a + 1u) % 4u] * 3u; }
void bump(inout uint v[4], uint k) { v[k % 4u] += 7u; }
uint arguments(uint a, uint b) { uint t[4] = uint[4](a, b, 3u, 4u); bump(t, a); bump(t, b); return t[0] + t[1] * 3u + t[2] * 5u + t[3] * 7u; }
uint counted(uint n) { Word p = Word(address + uint64_t(n) * 64ul + 32ul); p.v = 4u; return atomicAdd(p.v, n) + p.v * 3u; }
)", {{"through(a, n)"}, {"structured(a, x, n, 0u)"}, {"structured(a, x, n, 1u)"}, {"structured(a, x, n, 2u)"}, {"structured(a, x, n, 3u)"}, {"arguments(a, b)"}, {"counted(n)"}},
               [](const Device& d) { return d.vulkan12.bufferDeviceAddress && d.features.shaderInt64; }});
  f.push_back({"Images", R"(
ivec2 cell(uint n) { return ivec2(n % 64u, n / 64u % 16u); }
uint stored(uint a, uint n) { imageStore(img, cell(n), uvec4(a)); memoryBarrierImage(); barrier(); uint r = imageLoad(img, ivec2(63 - cell(n).x, cell(n).y)).x; barrier(); return r; }
uint counted(uint a, uint n) { imageStore(img, cell(n), uvec4(a)); uint r = imageAtomicAdd(img, cell(n), 5u); r += imageAtomicMax(img, cell(n), 77u) * 3u; r += imageAtomicXor(img, cell(n), 3u) * 5u; r += imageAtomicExchange(img, cell(n), 9u); r += imageAtomicCompSwap(img, cell(n), 9u, 8u); return r + imageLoad(img, cell(n)).x; }
vec2 uv(uint a, uint b) { return (vec2(a % 17u, b % 17u) + 0.25) / 16.0 - 0.1; }
)", {{"stored(a, n)"}, {"counted(a, n)"}, {"uint(imageSize(img).x * 100 + imageSize(img).y)"}, {"uint(textureSize(tex, 0).x * 100 + textureSize(tex, 0).y)"}, {"texelFetch(tex, ivec2(a % 16u, b % 16u), 0).y", kF, ulps<25>},
     {"textureLod(tex, uv(a, b), 0.0).x", kF, [](const Lane&, double) { return 0.004; }}, {"texture(tex, uv(a, b)).z", kF, [](const Lane&, double) { return 0.004; }}, {"textureGather(tex, (vec2(a % 15u, b % 15u) + 1.0) / 16.0, 1).w", kF, ulps<25>}, {"textureLodOffset(tex, uv(c, d), 0.0, ivec2(1, -2)).w", kF, [](const Lane&, double) { return 0.004; }}}});
  return f;
}

}  // namespace

const std::vector<InstructionFamily>& instructionFamilies() {
  static const std::vector<InstructionFamily> all = make();
  return all;
}

}  // namespace pumice::cts
