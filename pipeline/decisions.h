// Discrete decisions of fragments: which primitive a sample shows, and which branches, texels, levels and whole numbers its shaders
// chose, as a hash of 32 bits for each sample of a pass. Two runs of one program, in f32 and in double, agree in them where they
// differ by rounding only; a pixel where they do not is a *decision mismatch*. PUMICE_DECISIONS=write:FILE keeps the records of all
// passes, compare:FILE counts the pixels that differ from a file's.
#pragma once

#include <cstdint>
#include <vector>

namespace pumice::pipeline {

//! Decisions of a finished pass: words[((layer * samples + sample) * height + y) * width + x]. Where a draw replaces every colour, the
//! word is that of its fragment; else the fragments' words are chained. A clear in the middle of a pass does not undo them.
struct DecisionRecord {
  uint32_t width = 0, height = 0, layers = 0, samples = 0;
  std::vector<uint32_t> words;   //!< empty: nothing was recorded
};
//! Pixels in which two records of one shape differ (in any sample or layer).
uint64_t decisionMismatches(const DecisionRecord& a, const DecisionRecord& b);

//! Whether PUMICE_DECISIONS asks for records: then routines are made that keep them.
bool wantedDecisions();
//! Writes a pass's record to the file, or compares it with the next one there and prints the number of mismatches.
void keepDecisions(const DecisionRecord& record);

}  // namespace pumice::pipeline
