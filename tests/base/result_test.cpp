#include "base/result.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>

namespace pumice::base {
namespace {

Result<int> half(int number) {
  if (number % 2) return errorf("%d is odd", number);
  return number / 2;
}

Status checkQuarter(int number) {
  auto h = half(number);
  if (!h) return std::move(h).error();
  PUMICE_TRY(half(*h));
  return {};
}

Result<std::string> describe(int number) {
  PUMICE_TRY(checkQuarter(number));
  return std::string("divisible by four");
}

TEST(Result, HoldsTheValueOrTheError) {
  auto good = half(8);
  ASSERT_TRUE(good);
  EXPECT_EQ(*good, 4);
  EXPECT_EQ(good.valueOr(-1), 4);
  auto bad = half(7);
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().message, "7 is odd");
  EXPECT_EQ(bad.valueOr(-1), -1);
}

TEST(Result, TryLeavesWithTheFirstError) {
  EXPECT_TRUE(checkQuarter(8));
  EXPECT_EQ(checkQuarter(7).error().message, "7 is odd");
  EXPECT_EQ(checkQuarter(6).error().message, "3 is odd");
  EXPECT_EQ(*describe(4), "divisible by four");
  EXPECT_EQ(describe(6).error().message, "3 is odd");
}

TEST(Result, CarriesTypesThatOnlyMove) {
  Result<std::unique_ptr<int>> result(std::make_unique<int>(5));
  ASSERT_TRUE(result);
  EXPECT_EQ(**result, 5);
  std::unique_ptr<int> owned = *std::move(result);
  EXPECT_EQ(*owned, 5);
}

TEST(Result, AResultOfErrorTypeIsStillUnambiguous) {
  Result<std::string> text(std::string("not an error"));
  EXPECT_TRUE(text);
  EXPECT_EQ(text->size(), 12u);
}

TEST(Result, MessagesMayBeLong) {
  std::string word(5000, 'x');
  EXPECT_EQ(errorf("<%s>", word.c_str()).message, "<" + word + ">");
}

}  // namespace
}  // namespace pumice::base
