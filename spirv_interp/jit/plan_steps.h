// Steps of makePlan() that look at values one by one (plan_values.cpp), in this order. They need Plan::f, has, a and flat.
#pragma once

#include "spirv_interp/jit/plan.h"

namespace pumice::jit {

//! Values that are finite whatever their operands are (what was clamped, and arithmetic on it) make no NaN: Plan::a.nan, number, fitsInt, signless.
void settleBounded(Plan& p);
//! Signs that an fma changes at no cost, words that shuffles take from where they are: Plan::folded.
void findFolded(Plan& p);
//! Plan::pairFirst and pairSecond.
void findPairs(Plan& p);
//! Plan::crossed.
void findCrossed(Plan& p);
//! Plan::words and wordsOf (plan_words.cpp).
void findWords(Plan& p);
//! Plan::footprint.
void findFootprints(Plan& p);

}  // namespace pumice::jit
