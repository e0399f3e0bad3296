// What a random program (random_program.h) runs over: rows of inputs and outputs, tables, buffers, work-group memory, quad
// records and tiles, for several work groups of several rows. Made from a seed; every run begins with the same bytes.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "spirv_interp/interpreter/executor.h"
#include "tests/support/random_program.h"

namespace pumice::testing {

struct WorldShape {
  uint32_t rowLanes = interp::kMaxLanes;   //!< of each row (rounded up to quads if the program needs them)
  uint32_t groupRows = 1;                  //!< rows of a work group; groupRows * rowLanes <= kMaxGroupLanes
  uint32_t groups = 1;                     //!< groups * groupRows * rowLanes <= kMaxInvocations
  bool partial = false;                    //!< some lanes do not take part
  bool awkward = true;                     //!< infinities, NaNs, limits among the data
  bool wholeBlocks = false;                //!< quads come in fours that are neighbours in the planes, all with one record
};

//! One or several rows of any length, sometimes with lanes that do not take part, sometimes with calm data.
WorldShape randomShape(uint64_t seed);

//! All bytes that a run may change, as it left them.
struct Results {
  std::vector<std::byte> bytes;
  std::string error;
};

class World {
 public:
  World(const Program& program, uint64_t seed, WorldShape shape);
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  //! Runs all work groups; the threads share them.
  Results run(const interp::Executable& executable, unsigned threads = 1);
  //! The same by the reference (high-level maths is lowered first). The function is the program's own or an equal one.
  Results evaluate(const ir::Function& f, ir::Numerics numerics = ir::Numerics::F32);

  //! Empty, or the first difference for people.
  std::string difference(const Results& want, const Results& got) const;
  //! Value of an output slot; lanes count through rows and groups.
  uint64_t output(const Results& r, uint32_t slot, uint32_t lane) const;
  bool active(uint32_t lane) const { return active_[lane / shape_.rowLanes * 2 + lane % shape_.rowLanes / 64] >> lane % shape_.rowLanes % 64 & 1; }
  uint32_t lanes() const { return rows() * shape_.rowLanes; }

 private:
  struct Part {   // of the bytes that change
    std::string name;
    size_t begin, end, element;
  };
  uint32_t rows() const { return shape_.groupRows * shape_.groups; }
  size_t addPart(std::string name, size_t size, size_t element);
  void reset();
  std::byte* base() { return storage_.data() + (-reinterpret_cast<uintptr_t>(storage_.data()) & 63); }
  Results results() { return {{base(), base() + start_.size()}, {}}; }
  //! Of a group's rows.
  std::vector<interp::ExecContext> contexts(uint32_t group);

  const std::vector<ir::Type> inputTypes_, outputTypes_;
  WorldShape shape_;
  std::vector<Part> parts_;
  std::vector<std::byte> start_;               // the bytes that change, at the start of every run
  std::vector<std::byte> storage_;             // where they are
  size_t own_ = 0, totals_ = 0, outputs_ = 0;
  size_t shared_ = 0, tiles_[kTilePlanes] = {};
  std::vector<std::byte> inputs_, data_, moreData_, records_;
  std::vector<const void*> inputRows_;
  std::vector<void*> outputRows_;
  std::vector<std::byte> tableBytes_[ir::kTableCount];
  interp::Table tables_[ir::kTableCount] = {};
  std::vector<const std::byte*> recordPointers_;
  std::vector<uint32_t> elements_;             // of each quad in the planes
  std::vector<interp::TilePlane> planes_;      // by row and plane
  std::vector<uint64_t> active_;               // two words a row
};

}  // namespace pumice::testing
