// Control flow by hand as machine code: the bits of the interpreter.
#include "tests/interpreter/control_programs.h"
#include "tests/jit/every_width.h"

namespace pumice::interp {
namespace {

class JitControlFlow : public ::testing::TestWithParam<ControlProgram> {};

TEST_P(JitControlFlow, givesTheInterpretersBits) {
  if (!jit::available()) GTEST_SKIP();
  const Function f = parsed(GetParam());
  forControlRows([&](const RowRun& start) {
    RowRun want = start;
    want(f);
    inEveryWidth(f, start, [] {}, [&](const RowRun& run, uint32_t width, const std::string& listing) {
      for (unsigned k = 0; k < kControlOutputs; k++)
        ASSERT_EQ(std::memcmp(run.outputs[k].bytes, want.outputs[k].bytes, kMaxLanes * 4), 0)
            << "output " << k << ", " << start.lanes << " lanes in chunks of " << width << "\n" << listing;
      ASSERT_TRUE(run.shared == want.shared) << listing;
    });
  });
}
INSTANTIATE_TEST_SUITE_P(Programs, JitControlFlow, ::testing::ValuesIn(controlPrograms()), nameOfControlProgram);

}  // namespace
}  // namespace pumice::interp
