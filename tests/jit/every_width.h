// Machine code of a function for every number of lanes that a chunk may have.
#pragma once

#include <string>

#include "spirv_interp/jit/jit.h"
#include "tests/interpreter/fixture.h"

namespace pumice::interp {

//! Runs `f` from `start` in chunks of 8, 16 and 32 lanes: `check` gets what each left, the width and its listing. `prepare` comes before each run.
template <typename Prepare, typename Check>
void inEveryWidth(const Function& f, const RowRun& start, Prepare&& prepare, Check&& check) {
  for (uint32_t width : {8u, 16u, 32u}) {
    std::string listing;
    auto e = jit::compile(f, {}, {.chunkLanes = width, .upperFirst = width == 16, .listing = &listing});
    ASSERT_TRUE(e) << e.error().message;
    prepare();
    RowRun run = start;
    run.execute(**e);
    check(run, width, listing);
    if (::testing::Test::HasFatalFailure()) return;
  }
}

}  // namespace pumice::interp
