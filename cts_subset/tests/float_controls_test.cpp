// What the device promises of denormal numbers, signed zeros, infinities, NaN and rounding, asked for by execution modes.
#include "cts_subset/tests/compute.h"
#include "tests/support/compute_module.h"

#include <bit>
#include <cmath>
#include <limits>

namespace pumice::cts {
namespace {

enum Operation { kAdd, kSub, kMul, kDiv, kNegate, kAbs, kMin, kMax, kThroughWider, kSqrt, kLess, kUnorderedNotEqual, kOperations };

// %T is the type, %W a wider one, %a and %b are the operands; compared values become 0 or 1.
const char* const kCode[kOperations] = {
    "%v0 = OpFAdd %T %a %b\n",
    "%v1 = OpFSub %T %a %b\n",
    "%v2 = OpFMul %T %a %b\n",
    "%v3 = OpFDiv %T %a %b\n",
    "%v4 = OpFNegate %T %a\n",
    "%v5 = OpExtInst %T %glsl FAbs %a\n",
    "%v6 = OpExtInst %T %glsl NMin %a %b\n",
    "%v7 = OpExtInst %T %glsl NMax %a %b\n",
    "%wa = OpFConvert %W %a\n%wb = OpFConvert %W %b\n%wp = OpFMul %W %wa %wb\n%v8 = OpFConvert %T %wp\n",
    "%v9 = OpExtInst %T %glsl Sqrt %a\n",
    "%less = OpFOrdLessThan %bool %a %b\n%v10 = OpSelect %T %less %one %zero\n",
    "%other = OpFUnordNotEqual %bool %a %b\n%v11 = OpSelect %T %other %one %zero\n",
};

std::string moduleFor(const std::string& mode, uint32_t width, bool wider) {
  const std::string w = std::to_string(width);
  test::ComputeModule m{.buffers = {"%in", "%out"}, .element = "%T", .elementType = "%T = OpTypeFloat " + w + "\n", .elementBytes = width / 8};
  if (width == 16) m.head += "OpCapability Float16\nOpCapability StorageBuffer16BitAccess\n";
  if (width == 64 || (width == 32 && wider)) m.head += "OpCapability Float64\n";
  m.head += "OpCapability " + mode + "\nOpExtension \"SPV_KHR_float_controls\"\n";
  m.modes = "OpExecutionMode %main " + mode + " " + w + "\n";
  m.types = "%count = OpConstant %uint " + std::to_string(kOperations) + "\n%zero = OpConstant %T 0\n%one = OpConstant %T 1\n";
  if (wider && width < 64) m.types += "%W = OpTypeFloat " + std::to_string(width * 2) + "\n";
  m.body = test::kInvocation + std::string(R"(
%ia = OpIMul %uint %i %n2
%ib = OpIAdd %uint %ia %n1
%pa = OpAccessChain %ptr %in %n0 %ia
%a = OpLoad %T %pa
%pb = OpAccessChain %ptr %in %n0 %ib
%b = OpLoad %T %pb
%first = OpIMul %uint %i %count
)");
  for (int k = 0; k < kOperations; k++) {
    const std::string n = std::to_string(k);
    m.types += "%k" + n + " = OpConstant %uint " + n + "\n";
    m.body += k == kThroughWider && (!wider || width == 64) ? "%v8 = OpFMul %T %a %b\n" : kCode[k];
    m.body += "%at" + n + " = OpIAdd %uint %first %k" + n + "\n%p" + n + " = OpAccessChain %ptr %out %n0 %at" + n + "\nOpStore %p" + n + " %v" + n + "\n";
  }
  return textOf(m);
}

template <class T, class Bits, int kFraction>
struct Format {
  using Value = T;
  static T of(Bits bits) { return std::bit_cast<T>(bits); }
  static Bits bits(T v) { return std::bit_cast<Bits>(v); }
  static constexpr Bits kSign = Bits(Bits(1) << (8 * sizeof(T) - 1));
  static constexpr Bits kInfinity = Bits(Bits(kSign - 1) >> kFraction << kFraction);
  static bool nan(Bits b) { return Bits(b & ~kSign) > kInfinity; }
  static bool finite(Bits b) { return Bits(b & ~kSign) < kInfinity; }
  static bool denormal(Bits b) { return (b & ~kSign) && Bits(b & ~kSign) >> kFraction == 0; }

  // Zeros, denormals, the ends of the normal range, ties of rounding, infinities, NaN.
  static std::vector<Bits> specials() {
    const Bits one = Bits(kInfinity >> 1 >> kFraction << kFraction), ulp = 1;
    std::vector<Bits> v = {0, 1, 3, Bits(Bits(1) << (kFraction - 1)), Bits((Bits(1) << kFraction) - 1), Bits(Bits(1) << kFraction), Bits((Bits(1) << kFraction) + 1),
                           one, Bits(one + ulp), Bits(one + 3), Bits(one - ulp), Bits(one + (Bits(1) << (kFraction - 1))), Bits(one + (Bits(5) << kFraction) + 1),
                           Bits(one - (Bits(kFraction) << kFraction)), Bits(one - (Bits(kFraction + 1) << kFraction)), Bits(kInfinity - 1), Bits(kInfinity - (Bits(1) << kFraction)),
                           kInfinity, Bits(kInfinity | Bits(1) << (kFraction - 1))};
    for (size_t i = 0, n = v.size(); i < n; i++) v.push_back(Bits(v[i] | kSign));
    return v;
  }
};
using Half = Format<_Float16, uint16_t, 10>;
using Single = Format<float, uint32_t, 23>;
using Double = Format<double, uint64_t, 52>;

class FloatControls : public ComputeTest {
 protected:
  template <class F, class Bits = decltype(F::bits(typename F::Value{}))>
  void run(const char* mode, uint32_t width) {
    using T = typename F::Value;
    SCOPED_TRACE(testing::Message() << mode << " " << width);
    const bool denormals = std::string(mode) == "DenormPreserve", specials = std::string(mode) == "SignedZeroInfNanPreserve";
    const bool wider = width == 16 || (width == 32 && device().features.shaderFloat64);
    std::vector<Bits> in;
    const std::vector<Bits> v = F::specials();
    for (Bits a : v)
      for (Bits b : v) {
        // A mode promises something of its own numbers only. (Pumice keeps everything in every mode.)
        if (GetParam() == Role::kPeer && !specials && (!F::finite(a) || !F::finite(b))) continue;
        if (GetParam() == Role::kPeer && !denormals && (F::denormal(a) || F::denormal(b))) continue;
        in.insert(in.end(), {a, b});
      }
    while (in.size() % 128) in.push_back(F::bits(T(1)));
    ComputeSpec spec;
    spec.groups = uint32_t(in.size() / 128);
    const size_t words = in.size() / 2 * kOperations * sizeof(T) / 4;
    std::vector<Bits> out = valuesOf<Bits>(runCompute(device(), assemble(moduleFor(mode, width, wider)), wordsOf(in), words, spec));
    int wrong = 0;
    for (size_t i = 0; i < in.size() / 2; i++) {
      const T a = F::of(in[2 * i]), b = F::of(in[2 * i + 1]);
      const T smaller = F::nan(in[2 * i]) ? b : F::nan(in[2 * i + 1]) ? a : a < b ? a : b, larger = F::nan(in[2 * i]) ? b : F::nan(in[2 * i + 1]) ? a : a > b ? a : b;
      const T expected[kOperations] = {T(a + b), T(a - b), T(a * b), T(a / b), T(-a), F::of(Bits(in[2 * i] & ~F::kSign)), smaller, larger, T(a * b),
                                       T(std::sqrt(double(a))), T(a < b), T(!(a == b))};
      for (int k = 0; k < kOperations; k++) {
        const Bits want = F::bits(expected[k]), found = out[i * kOperations + k];
        if (F::nan(want) ? F::nan(found) : want == found) continue;
        if ((k == kMin || k == kMax) && a == b) continue;   // zeros of either sign
        // Results that are denormal are another mode's matter.
        if (GetParam() == Role::kPeer && !denormals && F::denormal(want)) continue;
        if (GetParam() == Role::kPeer && !specials && (!F::finite(want) || !(want & ~F::kSign))) continue;
        // Division and roots need not be correctly rounded, and say nothing about divisors at the ends of the range.
        if ((k == kDiv || k == kSqrt) && F::finite(want) && F::finite(found) && !F::denormal(in[2 * i]) && !F::denormal(in[2 * i + 1]) &&
            (want & ~F::kSign) && std::llabs(int64_t(want) - int64_t(found)) <= 3)
          continue;
        if (GetParam() == Role::kPeer && k == kDiv && (!F::finite(found) || !F::finite(want) || F::denormal(want) || F::denormal(in[2 * i + 1]))) continue;
        if (++wrong <= 8)
          ADD_FAILURE() << "operation " << k << " (" << kCode[k] << ") of " << std::hex << +in[2 * i] << " and " << +in[2 * i + 1] << " is " << +found << ", expected " << +want;
      }
    }
    EXPECT_EQ(wrong, 0);
  }
};

TEST_P(FloatControls, EveryModeThatIsReported) {
  const auto p = properties<VkPhysicalDeviceVulkan12Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES);
  struct Mode {
    const char* name;
    VkBool32 of16, of32, of64;
  };
  uint32_t modes = 0;
  for (const Mode& m : {Mode{"DenormPreserve", p.shaderDenormPreserveFloat16, p.shaderDenormPreserveFloat32, p.shaderDenormPreserveFloat64},
                        Mode{"SignedZeroInfNanPreserve", p.shaderSignedZeroInfNanPreserveFloat16, p.shaderSignedZeroInfNanPreserveFloat32, p.shaderSignedZeroInfNanPreserveFloat64},
                        Mode{"RoundingModeRTE", p.shaderRoundingModeRTEFloat16, p.shaderRoundingModeRTEFloat32, p.shaderRoundingModeRTEFloat64}}) {
    if (m.of16 && device().vulkan12.shaderFloat16 && device().vulkan11.storageBuffer16BitAccess) modes++, run<Half>(m.name, 16);
    if (m.of32) modes++, run<Single>(m.name, 32);
    if (m.of64 && device().features.shaderFloat64) modes++, run<Double>(m.name, 64);
  }
  if (GetParam() == Role::kTested) {
    EXPECT_EQ(modes, 9u) << "lane IR keeps all of it at every width";
    // What would need another arithmetic is not reported.
    EXPECT_FALSE(p.shaderDenormFlushToZeroFloat16 || p.shaderDenormFlushToZeroFloat32 || p.shaderDenormFlushToZeroFloat64);
    EXPECT_FALSE(p.shaderRoundingModeRTZFloat16 || p.shaderRoundingModeRTZFloat32 || p.shaderRoundingModeRTZFloat64);
  }
}

PUMICE_ON_BOTH_DEVICES(FloatControls);

}  // namespace
}  // namespace pumice::cts
