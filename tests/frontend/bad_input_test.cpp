// Hostile modules give errors: no crash, no hang, no gigabytes.
#include <gtest/gtest.h>

#include <sys/resource.h>

#include <chrono>
#include <random>

#include "base/threads.h"
#include "spirv_interp/frontend/module.h"
#include "spirv_interp/frontend/shader.h"
#include "tests/frontend/compile.h"
#include "tests/support/processor_time.h"

namespace pumice::frontend {
namespace {

const char* kFragment = R"(#version 450
layout(set=0, binding=0) uniform sampler2D tex[4];
layout(std140, set=0, binding=1) uniform U { mat4 m; vec4 a[8]; } u;
layout(std430, set=1, binding=2) buffer B { int n; vec2 v[]; } b;
layout(location=0) in vec4 c;
layout(location=1) flat in int k;
layout(location=0) out vec4 r;
layout(constant_id=3) const int N = 4;
struct S { float f; vec3 v[2]; };
float g(inout S s, int i) {
  switch (i) { case 0: s.f += 1; case 1: s.v[1].y = 3; break; default: return 2.0; }
  if (s.f > 10.0) discard;
  return s.f;
}
void main() {
  S s = S(c.x, vec3[2](c.xyz, vec3(1)));
  float t = 0;
  for (int i = 0; i < N; i++) { if (i == k) continue; t += g(s, i) * c.y; if (t > 5.0) break; }
  int local[5] = int[](1, 2, 3, 4, 5);
  r = texture(tex[k & 3], c.xy * s.v[k & 1].xy) + u.m * u.a[k] * t + dFdx(c) + float(local[k]);
  b.v[k] = normalize(r.xy);
  atomicAdd(b.n, b.v.length());
})";

std::vector<uint32_t> words() {
  std::string log;
  auto w = test::compileGlsl(test::GlslStage::Fragment, kFragment, &log);
  EXPECT_FALSE(w.empty()) << log;
  return w;
}

//! Translates without the validator before it, so that our own checks have to hold.
bool translateUnchecked(std::span<const uint32_t> w) {
  Module module;
  module.words.assign(w.begin(), w.end());
  if (!module.cut()) return false;
  return translate(module, Stage::Fragment, "main", {}).hasValue();
}

TEST(BadInput, TheModuleItselfIsGood) {
  auto w = words();
  auto module = parseModule(w);
  ASSERT_TRUE(module.hasValue()) << module.error().message;
  auto shader = translate(**module, Stage::Fragment, "main", {});
  EXPECT_TRUE(shader.hasValue()) << shader.error().message;
  EXPECT_TRUE(translateUnchecked(w));
}

TEST(BadInput, CutShortAtEveryWord) {
  auto w = words();
  for (size_t n = 0; n < w.size(); n++) {
    std::vector<uint32_t> cut(w.begin(), w.begin() + ptrdiff_t(n));
    EXPECT_FALSE(parseModule(cut).hasValue()) << n << " words";
    EXPECT_FALSE(translateUnchecked(cut)) << n << " words";
  }
}

TEST(BadInput, ForeignEndianness) {
  auto w = words();
  for (uint32_t& word : w) word = __builtin_bswap32(word);
  auto module = parseModule(w);
  ASSERT_TRUE(module.hasValue()) << module.error().message;
  EXPECT_TRUE(translate(**module, Stage::Fragment, "main", {}).hasValue());
}

TEST(BadInput, TheValidatorBesideSaysWhatItSaysBefore) {
  int refused = 0;
  for (size_t at = 5; at < words().size() && !refused; at++) {
    auto w = words();
    w[at]++;
    auto first = parseModule(w);
    if (!translateUnchecked(w) || first.hasValue()) continue;
    auto module = parseModule(w, Validate::Beside);
    ASSERT_TRUE(module.hasValue()) << module.error().message;
    EXPECT_EQ(validity(**module).error().message, first.error().message);
    base::ThreadPool workers(2);
    module = parseModule(w, Validate::Beside, &workers);
    ASSERT_TRUE(module.hasValue()) << module.error().message;
    EXPECT_EQ(validity(**module, &workers).error().message, first.error().message);
    // One that nobody asks may go while a worker reads it.
    for (int i = 0; i < 20; i++) (void)parseModule(w, Validate::Beside, &workers);
    refused++;
  }
  EXPECT_EQ(refused, 1) << "no change of one word that the translator takes and the validator does not";
}

TEST(BadInput, AbsurdIdBound) {
  auto w = words();
  w[3] = 0xffffffff;
  EXPECT_FALSE(parseModule(w).hasValue());
  w[3] = 2;
  EXPECT_FALSE(parseModule(w).hasValue());
}

TEST(BadInput, WrongEntryPointAndStageAreNamed) {
  auto w = words();
  auto module = parseModule(w);
  ASSERT_TRUE(module.hasValue());
  auto missing = translate(**module, Stage::Fragment, "other", {});
  ASSERT_FALSE(missing.hasValue());
  EXPECT_NE(missing.error().message.find("other"), std::string::npos);
  EXPECT_FALSE(translate(**module, Stage::Vertex, "main", {}).hasValue());
}

void mutate(const std::vector<uint32_t>& original) {
  std::random_device seedSource;
  uint32_t seed = seedSource();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  int rounds = 0, accepted = 0;
  for (; rounds < 20000 && std::chrono::steady_clock::now() < end; rounds++) {
    auto w = original;
    for (uint32_t n = 1 + random() % 3; n > 0; n--) {
      size_t at = 5 + random() % (w.size() - 5);
      switch (random() % 5) {
        case 0: w[at] = random(); break;
        case 1: w[at] = random() % w[3]; break;
        case 2: w[at] ^= 1u << random() % 32; break;
        case 3: w[at] = w[5 + random() % (w.size() - 5)]; break;
        case 4: w[at] += random() % 3 - 1; break;
      }
    }
    accepted += translateUnchecked(w);
    if (rounds % 8 == 0) {
      auto module = parseModule(w);
      if (module) (void)translate(**module, Stage::Fragment, "main", {}).hasValue();
    }
  }
  testing::Test::RecordProperty("rounds", rounds);
  testing::Test::RecordProperty("accepted", accepted);
  EXPECT_GT(rounds, 100);
}

TEST(BadInput, MutatedWords) { mutate(words()); }
TEST(BadInput, MutatedWordsOfAnOptimisedModule) { mutate(test::optimised(words())); }

// Calls that double at each level would give 2^40 copies.
TEST(BadInput, ExponentialInliningEndsInAnError) {
  std::string source = "#version 450\nlayout(location=0) out vec4 r;\nlayout(location=0) in vec4 c;\n"
                       "vec4 f0(vec4 x) { return x * c; }\n";
  for (int i = 1; i < 40; i++) {
    std::string n = std::to_string(i), m = std::to_string(i - 1);
    source += "vec4 f" + n + "(vec4 x) { return f" + m + "(x) + f" + m + "(x.yxzw); }\n";
  }
  source += "void main() { r = f39(c); }\n";
  std::string log;
  auto w = test::compileGlsl(test::GlslStage::Fragment, source, &log);
  ASSERT_FALSE(w.empty()) << log;
  auto module = parseModule(w);
  ASSERT_TRUE(module.hasValue()) << module.error().message;
  auto shader = translate(**module, Stage::Fragment, "main", {});
  ASSERT_FALSE(shader.hasValue());
  EXPECT_NE(shader.error().message.find("too large"), std::string::npos) << shader.error().message;
}

// --- absurd counts: each must end soon, in an error or a shader, within moderate memory

//! Writes modules word by word, as no compiler would.
struct Writer {
  std::vector<uint32_t> words{0x07230203, 0x00010300, 0, 0, 0};
  uint32_t bound = 1;

  uint32_t id() { return bound++; }
  void op(spv::Op op, std::initializer_list<uint32_t> operands) { this->op(op, std::vector<uint32_t>(operands)); }
  void op(spv::Op op, const std::vector<uint32_t>& operands) {
    words.push_back(uint32_t(operands.size() + 1) << 16 | uint32_t(op));
    words.insert(words.end(), operands.begin(), operands.end());
  }
  uint32_t main = 0, voidType = 0, functionType = 0, floatType = 0, uintType = 0, boolType = 0, n0 = 0, yes = 0;

  Writer() {
    op(spv::Op::OpCapability, {uint32_t(spv::Capability::Shader)});
    op(spv::Op::OpMemoryModel, {0, 1});
    main = id();
    op(spv::Op::OpEntryPoint, {uint32_t(spv::ExecutionModel::GLCompute), main, 0x6e69616d, 0});
    op(spv::Op::OpExecutionMode, {main, uint32_t(spv::ExecutionMode::LocalSize), 1, 1, 1});
    decorations = words.size();
    voidType = id(), functionType = id(), floatType = id(), uintType = id(), boolType = id(), n0 = id(), yes = id();
    op(spv::Op::OpTypeVoid, {voidType});
    op(spv::Op::OpTypeFunction, {functionType, voidType});
    op(spv::Op::OpTypeFloat, {floatType, 32});
    op(spv::Op::OpTypeInt, {uintType, 32, 0});
    op(spv::Op::OpTypeBool, {boolType});
    op(spv::Op::OpConstant, {uintType, n0, 0});
    op(spv::Op::OpConstantTrue, {boolType, yes});
  }
  size_t decorations = 0;
  uint32_t constant(uint32_t value) {
    uint32_t result = id();
    op(spv::Op::OpConstant, {uintType, result, value});
    return result;
  }
  uint32_t type(spv::Op kind, std::vector<uint32_t> operands) {
    uint32_t result = id();
    operands.insert(operands.begin(), result);
    op(kind, operands);
    return result;
  }
  uint32_t variable(spv::StorageClass storage, uint32_t pointee) {
    uint32_t pointer = type(spv::Op::OpTypePointer, {uint32_t(storage), pointee}), result = id();
    op(spv::Op::OpVariable, {pointer, result, uint32_t(storage)});
    return result;
  }
  void beginMain() {
    op(spv::Op::OpFunction, {voidType, main, 0, functionType});
    op(spv::Op::OpLabel, {id()});
  }
  void endMain() {
    op(spv::Op::OpReturn, {});
    op(spv::Op::OpFunctionEnd, {});
    words[3] = bound;
  }
};

long peakKilobytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

//! Both with and without the validator; gives the error.
std::string soon(Writer& w, double seconds = 5) {
  long before = peakKilobytes();
  double start = pumice::test::processorSeconds();
  std::string error;
  auto module = parseModule(w.words);
  if (module) {
    auto shader = translate(**module, Stage::Compute, "main", {});
    if (!shader) error = shader.error().message;
  } else {
    error = module.error().message;
  }
  Module unchecked;
  unchecked.words = w.words;
  if (unchecked.cut()) (void)translate(unchecked, Stage::Compute, "main", {}).hasValue();
  double took = pumice::test::processorSeconds() - start;
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  (void)before, (void)took, (void)seconds;
#else
  EXPECT_LT(took, seconds) << error;
  EXPECT_LT(peakKilobytes() - before, 1'000'000) << error;
#endif
  return error;
}

TEST(Absurd, AnEmptyMainIsGood) {
  Writer w;
  w.beginMain();
  w.endMain();
  EXPECT_EQ(soon(w), "");
}

TEST(Absurd, ArraysOfBillions) {
  for (auto storage : {spv::StorageClass::Private, spv::StorageClass::Workgroup}) {
    for (uint32_t length : {0u, 0xffffffffu, 1u << 30, 1u << 20}) {
      Writer w;
      uint32_t n = w.constant(length), array = w.type(spv::Op::OpTypeArray, {w.floatType, n});
      uint32_t outer = w.type(spv::Op::OpTypeArray, {array, n}), v = w.variable(storage, outer);
      uint32_t pointer = w.type(spv::Op::OpTypePointer, {uint32_t(storage), w.floatType}), p = w.id(), value = w.id();
      w.beginMain();
      w.op(spv::Op::OpAccessChain, {pointer, p, v, w.n0, w.n0});
      w.op(spv::Op::OpLoad, {w.floatType, value, p});
      w.endMain();
      EXPECT_NE(soon(w), "") << length;
    }
  }
}

TEST(Absurd, StructuresOfStructuresOfThousandsOfMembers) {
  for (int levels = 1; levels <= 4; levels++) {
    Writer w;
    uint32_t inner = w.floatType;
    for (int k = 0; k < levels; k++) inner = w.type(spv::Op::OpTypeStruct, std::vector<uint32_t>(65000, inner));
    uint32_t v = w.variable(spv::StorageClass::Private, inner), value = w.id();
    w.beginMain();
    w.op(spv::Op::OpLoad, {inner, value, v});
    for (int k = 0; k < 2000; k++) {
      uint32_t part = w.id();
      w.op(spv::Op::OpCompositeExtract, {w.floatType, part, value, uint32_t(64000 + k % 1000)});
    }
    w.endMain();
    std::string error = soon(w);
    if (levels > 1) {
      EXPECT_NE(error, "");
    }
  }
}

// Nothing at the bottom: no scalar is ever counted.
TEST(Absurd, StructuresOfEmptyStructures) {
  Writer w;
  uint32_t inner = w.type(spv::Op::OpTypeStruct, {});
  for (int k = 0; k < 4; k++) inner = w.type(spv::Op::OpTypeStruct, std::vector<uint32_t>(65000, inner));
  uint32_t outer = w.type(spv::Op::OpTypeStruct, {w.floatType, inner});
  uint32_t v = w.variable(spv::StorageClass::Private, outer), value = w.id();
  w.beginMain();
  w.op(spv::Op::OpLoad, {outer, value, v});
  w.op(spv::Op::OpStore, {v, value});
  w.endMain();
  soon(w);
}

TEST(Absurd, DeeplyNestedTypes) {
  Writer w;
  uint32_t two = w.constant(2), inner = w.floatType;
  for (int k = 0; k < 100'000; k++)
    inner = k % 2 ? w.type(spv::Op::OpTypeArray, {inner, two}) : w.type(spv::Op::OpTypeStruct, {inner});
  w.variable(spv::StorageClass::Private, inner);
  w.beginMain();
  w.endMain();
  EXPECT_NE(soon(w), "");
}

TEST(Absurd, AMillionConstants) {
  Writer w;
  uint32_t n = w.constant(60000), array = w.type(spv::Op::OpTypeArray, {w.uintType, n});
  uint32_t outer = w.type(spv::Op::OpTypeArray, {array, w.constant(16)});
  std::vector<uint32_t> rows;
  for (uint32_t row = 0; row < 16; row++) {
    std::vector<uint32_t> elements;
    for (uint32_t i = 0; i < 60000; i++) elements.push_back(w.constant(row * 60000 + i));
    uint32_t composite = w.id();
    elements.insert(elements.begin(), {array, composite});
    w.op(spv::Op::OpConstantComposite, elements);
    rows.push_back(composite);
  }
  uint32_t all = w.id();
  rows.insert(rows.begin(), {outer, all});
  w.op(spv::Op::OpConstantComposite, rows);
  w.beginMain();
  w.endMain();
  EXPECT_NE(soon(w, 10), "");
}

// Each level holds the one before it twice: 2^60 scalars.
TEST(Absurd, ConstantsThatDouble) {
  Writer w;
  uint32_t type = w.uintType, value = w.n0;
  for (int k = 0; k < 60; k++) {
    type = w.type(spv::Op::OpTypeStruct, {type, type});
    uint32_t composite = w.id();
    w.op(spv::Op::OpConstantComposite, {type, composite, value, value});
    value = composite;
  }
  w.beginMain();
  w.endMain();
  EXPECT_NE(soon(w), "");
}

// A large value copied again and again takes no instructions of lane IR.
TEST(Absurd, CopiesOfALargeValue) {
  Writer w;
  uint32_t array = w.type(spv::Op::OpTypeArray, {w.uintType, w.constant(60000)}), null = w.id();
  w.op(spv::Op::OpConstantNull, {array, null});
  w.beginMain();
  for (int k = 0; k < 100'000; k++) {
    uint32_t copy = w.id();
    w.op(spv::Op::OpCopyObject, {array, copy, null});
  }
  w.endMain();
  EXPECT_NE(soon(w), "");
}

TEST(Absurd, ManyLargeVariables) {
  for (auto storage : {spv::StorageClass::Private, spv::StorageClass::Workgroup, spv::StorageClass::Function}) {
    Writer w;
    uint32_t array = w.type(spv::Op::OpTypeArray, {w.uintType, w.constant(60000)});
    uint32_t pointer = w.type(spv::Op::OpTypePointer, {uint32_t(storage), array});
    if (storage == spv::StorageClass::Function) w.beginMain();
    for (int k = 0; k < 50'000; k++) w.op(spv::Op::OpVariable, {pointer, w.id(), uint32_t(storage)});
    if (storage != spv::StorageClass::Function) w.beginMain();
    w.endMain();
    EXPECT_NE(soon(w), "");
  }
}

TEST(Absurd, DeeplyNestedConstructs) {
  for (int levels : {100, 1000, 2000, 50'000}) {
    Writer w;
    w.beginMain();
    std::vector<uint32_t> merges;
    for (int k = 0; k < levels; k++) {
      uint32_t inside = w.id(), merge = w.id();
      w.op(spv::Op::OpSelectionMerge, {merge, 0});
      w.op(spv::Op::OpBranchConditional, {w.yes, inside, merge});
      w.op(spv::Op::OpLabel, {inside});
      merges.push_back(merge);
    }
    for (; !merges.empty(); merges.pop_back()) {
      w.op(spv::Op::OpBranch, {merges.back()});
      w.op(spv::Op::OpLabel, {merges.back()});
    }
    w.endMain();
    EXPECT_EQ(soon(w, 10).empty(), levels == 100) << levels;
  }
}

TEST(Absurd, ASwitchOfThousandsOfCasesThatFallThrough) {
  Writer w;
  w.beginMain();
  uint32_t merge = w.id(), first = w.bound;
  constexpr uint32_t kCases = 20'000;
  w.bound += kCases;
  std::vector<uint32_t> operands{w.n0, merge};
  for (uint32_t k = 0; k < kCases; k++) operands.insert(operands.end(), {k, first + k});
  w.op(spv::Op::OpSelectionMerge, {merge, 0});
  w.op(spv::Op::OpSwitch, operands);
  for (uint32_t k = 0; k < kCases; k++) {
    w.op(spv::Op::OpLabel, {first + k});
    w.op(spv::Op::OpBranch, {k + 1 < kCases ? first + k + 1 : merge});
  }
  w.op(spv::Op::OpLabel, {merge});
  w.endMain();
  soon(w, 20);
}

TEST(Absurd, ALongChainOfCallsAndAFunctionThatCallsItself) {
  for (auto [circle, length] : {std::pair(false, 900), {false, 20'000}, {true, 900}, {true, 20'000}}) {
    Writer w;
    w.beginMain();
    uint32_t next = w.id();
    w.op(spv::Op::OpFunctionCall, {w.voidType, w.id(), next});
    w.op(spv::Op::OpReturn, {});
    w.op(spv::Op::OpFunctionEnd, {});
    uint32_t first = next;
    for (int k = 0; k < length; k++) {
      w.op(spv::Op::OpFunction, {w.voidType, next, 0, w.functionType});
      w.op(spv::Op::OpLabel, {w.id()});
      next = k == length - 1 ? first : w.id();
      if (circle || k < length - 1) w.op(spv::Op::OpFunctionCall, {w.voidType, w.id(), next});
      w.op(spv::Op::OpReturn, {});
      w.op(spv::Op::OpFunctionEnd, {});
    }
    w.words[3] = w.bound;
    EXPECT_NE(soon(w, 10), "");
  }
}

}  // namespace
}  // namespace pumice::frontend
