#include "tests/support/world.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cstdio>
#include <cstring>
#include <numeric>
#include <thread>

#include "base/fpenv.h"
#include "spirv_interp/ir/passes.h"
#include "tests/support/reference.h"

namespace pumice::testing {
namespace {

using interp::ExecContext, interp::Progress, interp::kMaxLanes;
using ir::Type;

constexpr size_t kRowBytes = size_t(kMaxLanes) * 8;

void fill(Choices& r, std::vector<std::byte>& bytes, bool awkward) {
  // Elements of all sizes, so that whoever reads finds something of interest.
  static constexpr Type kTypes[] = {Type::F32, Type::I32, Type::F32, Type::F16, Type::I8, Type::F64, Type::I64, Type::I16};
  for (size_t at = 0; at < bytes.size();) {
    const Type t = r.of(kTypes);
    const uint64_t v = awkward ? awkwardBits(r, t) : calmBits(r, t);
    const size_t n = std::min<size_t>(ir::typeBytes(t), bytes.size() - at);
    std::memcpy(bytes.data() + at, &v, n);
    at += n;
  }
}

}  // namespace

WorldShape randomShape(uint64_t seed) {
  Choices r(seed + 77);
  static constexpr WorldShape kShapes[] = {{.rowLanes = 128}, {.rowLanes = 32}, {.rowLanes = 3, .groupRows = 2}, {.rowLanes = 32, .groupRows = 3, .groups = 2},
                                           {.rowLanes = 128, .groupRows = 2, .groups = 2}, {.rowLanes = 1}, {.rowLanes = 5, .groups = 3},
                                           {.rowLanes = 127}, {.rowLanes = 64}, {.rowLanes = 20, .groupRows = 4}};
  WorldShape shape = r.of(kShapes);
  shape.partial = r.chance(30);
  shape.awkward = r.chance(50);
  return shape;
}

World::World(const Program& program, uint64_t seed, WorldShape shape)
    : inputTypes_(program.inputs), outputTypes_(program.outputs), shape_(shape) {
  if (program.quads) shape_.rowLanes = (shape_.rowLanes + 3) & ~3u;
  assert(shape_.groupRows * shape_.rowLanes <= kMaxGroupLanes && lanes() <= kMaxInvocations);
  Choices r(seed ^ 0x5bd1e995);

  outputs_ = addPart("output", rows() * outputTypes_.size() * kRowBytes, kRowBytes);
  own_ = addPart("own memory", kOwnBytes, 1);
  totals_ = addPart("totals", kTotalsBytes, 8);
  shared_ = addPart("work-group memory", size_t(shape_.groups) * ir::oracleSharedBytes(kSharedBytes), 1);
  const uint32_t quads = (lanes() + 3) / 4;
  for (uint32_t p = 0; p < kTilePlanes; p++) tiles_[p] = addPart("tile plane " + std::to_string(p), size_t(quads) * 4 * kTileElementBytes[p], kTileElementBytes[p]);
  fill(r, start_, shape_.awkward);
  storage_.resize(start_.size() + 64);

  data_.resize(kDataBytes);
  moreData_.resize(kMoreDataBytes);
  records_.resize(size_t(quads) * kQuadRecordBytes);
  for (auto* bytes : {&data_, &moreData_, &records_}) fill(r, *bytes, shape_.awkward);
  for (uint32_t t = 0; t < ir::kTableCount; t++) {
    tableBytes_[t].resize(t == ir::kTableDraw ? kDrawData + kDrawDataBytes : kTableBytes);
    fill(r, tableBytes_[t], shape_.awkward);
    tables_[t] = {tableBytes_[t].data(), tableBytes_[t].size()};
  }
  const std::pair<const void*, uint64_t> buffers[] = {{data_.data(), kDataBytes}, {moreData_.data(), kMoreDataBytes}, {base() + own_, kOwnBytes}, {base() + totals_, kTotalsBytes}};
  for (uint32_t k = 0; k < std::size(buffers); k++) {
    const uint64_t entry[] = {reinterpret_cast<uintptr_t>(buffers[k].first), buffers[k].second};
    std::memcpy(tableBytes_[ir::kTableDraw].data() + bufferConstant(BufferId(k)), entry, sizeof entry);
  }

  // Quads lie in the planes in an order of their own.
  elements_.resize(quads);
  std::iota(elements_.begin(), elements_.end(), 0);
  if (shape_.wholeBlocks) {
    assert(shape_.rowLanes % 32 == 0 && !shape_.partial);
    for (size_t k = quads / 4; k-- > 1;) {
      const uint32_t other = r.below(uint32_t(k + 1));
      for (uint32_t q = 0; q < 4; q++) std::swap(elements_[k * 4 + q], elements_[other * 4 + q]);
    }
  } else {
    for (size_t k = quads; k-- > 1;) std::swap(elements_[k], elements_[r.below(uint32_t(k + 1))]);
  }
  for (uint32_t& e : elements_) e *= 4;
  for (uint32_t q = 0; q < quads; q++) recordPointers_.push_back(records_.data() + (shape_.wholeBlocks ? 0 : size_t(q) * kQuadRecordBytes));
  for (uint32_t row = 0; row < rows(); row++)
    for (uint32_t p = 0; p < kTilePlanes; p++) planes_.push_back({base() + tiles_[p], elements_.data() + row * shape_.rowLanes / 4});

  inputs_.resize(rows() * inputTypes_.size() * kRowBytes);
  for (uint32_t row = 0; row < rows(); row++) {
    for (size_t slot = 0; slot < inputTypes_.size(); slot++) {
      std::byte* bytes = inputs_.data() + (row * inputTypes_.size() + slot) * kRowBytes;
      inputRows_.push_back(bytes);
      const Type t = inputTypes_[slot];
      for (uint32_t l = 0; l < kMaxLanes; l++) {
        uint64_t v = shape_.awkward ? awkwardBits(r, t) : calmBits(r, t);
        if (slot == kGlobalIndex) v = row * shape_.rowLanes + l;
        if (slot == kLocalIndex) v = row % shape_.groupRows * shape_.rowLanes + l;
        if (t == Type::Mask) bytes[l / 8] |= std::byte(v << l % 8);
        else std::memcpy(bytes + l * ir::typeBytes(t), &v, ir::typeBytes(t));
      }
    }
    for (size_t slot = 0; slot < outputTypes_.size(); slot++) outputRows_.push_back(base() + outputs_ + (row * outputTypes_.size() + slot) * kRowBytes);
    for (uint32_t w = 0; w < 2; w++) {
      const uint64_t all = shape_.rowLanes >= (w + 1) * 64 ? ~uint64_t(0) : shape_.rowLanes <= w * 64 ? 0 : (uint64_t(1) << (shape_.rowLanes - w * 64)) - 1;
      active_.push_back(shape_.partial ? r.next() & all : all);
    }
  }
}

size_t World::addPart(std::string name, size_t size, size_t element) {
  const size_t begin = (start_.size() + 63) & ~size_t(63);
  start_.resize(begin + size);
  parts_.push_back({std::move(name), begin, begin + size, element});
  return begin;
}

void World::reset() { std::memcpy(base(), start_.data(), start_.size()); }

std::vector<ExecContext> World::contexts(uint32_t group) {
  std::vector<ExecContext> list(shape_.groupRows);
  for (uint32_t k = 0; k < shape_.groupRows; k++) {
    const uint32_t row = group * shape_.groupRows + k;
    ExecContext& c = list[k];
    c.lanes = shape_.rowLanes;
    std::memcpy(c.active, &active_[row * 2], sizeof c.active);
    c.inputs = inputRows_.data() + row * inputTypes_.size();
    c.outputs = outputRows_.data() + row * outputTypes_.size();
    c.tables = tables_;
    c.quadRecords = recordPointers_.data() + row * shape_.rowLanes / 4;
    c.tilePlanes = planes_.data() + row * kTilePlanes;
    c.shared = base() + shared_ + size_t(group) * ir::oracleSharedBytes(kSharedBytes);
    c.sharedBytes = ir::oracleSharedBytes(kSharedBytes);
  }
  return list;
}

Results World::run(const interp::Executable& executable, unsigned threads) {
  reset();
  const base::ScopedFpEnv environment;
  const interp::UniformBank bank = executable.preamble(tables_);
  std::atomic<uint32_t> next{0};
  auto work = [&] {
    const base::ScopedFpEnv own;
    for (uint32_t group; (group = next++) < shape_.groups;) {
      const std::vector<ExecContext> rows = contexts(group);
      if (rows.size() == 1) {
        executable.run(bank, rows[0]);
        continue;
      }
      std::vector<std::unique_ptr<interp::RowState>> states(rows.size());
      std::vector<Progress> progress(rows.size());
      for (size_t k = 0; k < rows.size(); k++) {
        states[k] = executable.newRowState();
        progress[k] = executable.start(bank, rows[k], *states[k]);
      }
      for (;;) {
        const bool yielded = std::find(progress.begin(), progress.end(), Progress::Yielded) != progress.end();
        bool moved = false;
        for (size_t k = 0; k < rows.size(); k++)
          if (progress[k] == (yielded ? Progress::Yielded : Progress::Barrier)) {
            progress[k] = executable.resume(*states[k]);
            moved = true;
          }
        if (!moved) break;
      }
    }
  };
  std::vector<std::thread> others;
  for (unsigned k = 1; k < threads; k++) others.emplace_back(work);
  work();
  for (std::thread& t : others) t.join();
  return results();
}

Results World::evaluate(const ir::Function& f, ir::Numerics numerics) {
  ir::Function lowered = f;
  ir::lowerMath(lowered, numerics);
  if (numerics == ir::Numerics::Oracle) ir::widenFloats(lowered);
  reset();
  const base::ScopedFpEnv environment;
  std::string error;
  for (uint32_t group = 0; group < shape_.groups && error.empty(); group++) error = runReference(lowered, contexts(group));
  Results r = results();
  r.error = error;
  return r;
}

std::string World::difference(const Results& want, const Results& got) const {
  for (const Results* r : {&want, &got})
    if (!r->error.empty()) return r->error;
  for (const Part& p : parts_)
    for (size_t at = p.begin; at < p.end; at++) {
      if (want.bytes[at] == got.bytes[at]) continue;
      const size_t offset = at - p.begin;
      char text[256];
      if (p.begin != outputs_) {
        std::snprintf(text, sizeof text, "%s: byte %zu: %02x, not %02x", p.name.c_str(), offset, unsigned(got.bytes[at]), unsigned(want.bytes[at]));
        return text;
      }
      const uint32_t row = uint32_t(offset / kRowBytes / outputTypes_.size()), slot = uint32_t(offset / kRowBytes % outputTypes_.size());
      const Type t = outputTypes_[slot];
      uint32_t inRow = uint32_t(offset % kRowBytes / std::max(1u, ir::typeBytes(t)));
      if (t == Type::Mask) inRow = uint32_t(offset % kRowBytes * 8) + uint32_t(__builtin_ctz(unsigned(want.bytes[at] ^ got.bytes[at])));
      if (inRow >= shape_.rowLanes) continue;   // whole vectors may be written
      const uint32_t lane = row * shape_.rowLanes + inRow;
      std::snprintf(text, sizeof text, "output %u, row %u, lane %u%s: %#llx, not %#llx", slot, row, inRow, active(lane) ? "" : " (does not take part)",
                    static_cast<unsigned long long>(output(got, slot, lane)), static_cast<unsigned long long>(output(want, slot, lane)));
      return text;
    }
  return {};
}

uint64_t World::output(const Results& r, uint32_t slot, uint32_t lane) const {
  const uint32_t row = lane / shape_.rowLanes, inRow = lane % shape_.rowLanes;
  const std::byte* bytes = r.bytes.data() + outputs_ + (row * outputTypes_.size() + slot) * kRowBytes;
  const Type t = outputTypes_[slot];
  if (t == Type::Mask) return uint64_t(bytes[inRow / 8]) >> (inRow % 8) & 1;
  uint64_t v = 0;
  std::memcpy(&v, bytes + inRow * ir::typeBytes(t), ir::typeBytes(t));
  return v;
}

}  // namespace pumice::testing
