// Random float programs without decisions: f32 is as near to the oracle as an error bound that is carried along says.
#include <gtest/gtest.h>

#include "tests/support/near_oracle.h"

namespace pumice::interp {
namespace {

TEST(NearOracle, f32KeepsWithinTheErrorThatItsStepsMayMake) {
  testing::NearOracleCounts counts;
  for (uint64_t seed = 1; seed <= 300; seed++) {
    testing::Choices choices(seed);
    ASSERT_EQ(testing::nearOracleProblem(choices, counts), "") << "seed " << seed;
  }
  // The bounds say something, and there is something to say.
  EXPECT_GT(counts.checked, counts.values / 2);
  EXPECT_GT(counts.sharp, counts.checked / 2);
  EXPECT_GT(counts.differ, counts.checked / 20);
}

}  // namespace
}  // namespace pumice::interp
