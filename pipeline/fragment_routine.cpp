// Interpolation, fragment shader, tests and colour writes as one routine over quads.
//
// Lanes: without helper lanes exactly the covered pixels are active. With them whole quads are active and `live` says
// which lanes are real. Tests come before the shader where nothing can tell the difference, else after it; a lane that
// fails an early test runs the shader only as a helper of its quad.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <limits>
#include <set>

#include "base/log.h"
#include "pipeline/builders.h"
#include "pipeline/ideas.h"
#include "spirv_interp/ir/checks.h"
#include "spirv_interp/ir/decisions.h"
#include "spirv_interp/ir/fold.h"
#include "spirv_interp/ir/one_record.h"

namespace pumice::pipeline {

using ir::Op;
using ir::Type;
using ir::Value;
using texture::Texel;

namespace {

constexpr uint32_t kSlotX = 0, kSlotY = 1, kSlotCoverage = 2, kSlotSample = 3, kSlotCentreX = 4, kSlotCentreY = 5, kSlotPassed = 0, kSlotShaded = 1;
constexpr uint32_t kPlaneDepth = 0, kPlaneInverseW = 1, kPlaneVaryings = 2;
//! Where a plane lies in a record.
constexpr uint32_t planeOffset(uint32_t plane, bool wide = false) { return raster::kRecordPlanes + (wide ? 24 : 12) * plane; }
constexpr uint64_t kSwapX = 0xb1, kSwapY = 0x4e;   // lanes 1 0 3 2 and 2 3 0 1 of a quad

Value both(ir::Builder& b, Value x, Value y) { return !x ? y : !y ? x : b.maskAnd(x, y); }

//! True on all lanes of a quad that has a lane where m is true.
Value quadAny(ir::Builder& b, Value m) {
  Value v = b.select(m, b.i32(1), b.i32(0));
  v = b.or_(v, b.emit(Op::QuadSwizzle, Type::I32, {v}, kSwapX));
  v = b.or_(v, b.emit(Op::QuadSwizzle, Type::I32, {v}, kSwapY));
  return b.ine(v, b.i32(0));
}

struct ShaderTraits {
  bool writesSampleMask = false;
  bool writesStencilRef = false;
  bool early = true;       // tests before the shader
  bool needsHelpers = false;
  bool guarded = false;    // there may be lanes whose memory accesses must not happen
  bool perSample = false;
};

ShaderTraits traits(const GraphicsState& state, const frontend::Shader* shader) {
  ShaderTraits t;
  if (!shader) return t;
  for (uint64_t imm : writtenOutputs(*shader)) {
    const auto& v = shader->outputs[imm >> 32];
    if (v.builtIn && v.location == kSampleMask) t.writesSampleMask = true;
    if (v.builtIn && v.location == kFragStencilRef) t.writesStencilRef = true;
  }
  // What a test writes must not be there yet when the shader reads that attachment.
  const bool readsAttachments = std::any_of(shader->resources.begin(), shader->resources.end(), [](const frontend::Resource& r) {
    return r.kind == frontend::ResourceKind::InputAttachment;
  });
  t.early = shader->earlyFragmentTests || !(state.feedbackLoop || shader->mayDiscard || shader->writesDepth || shader->writesMemory || readsAttachments ||
                                            state.alphaToCoverage || t.writesSampleMask || t.writesStencilRef);
  t.needsHelpers = shader->usesDerivatives;
  // A fraction of the samples may be shaded; all of them always satisfies it.
  t.perSample = state.samples > 1 && (shader->usesSampleRate || (state.sampleShading && state.minSampleShading * float(state.samples) > 1));
  t.guarded = shader->writesMemory && (t.needsHelpers || shader->mayDiscard || t.perSample);
  return t;
}

class FragmentExpander : public StageExpander {
 public:
  FragmentExpander(const GraphicsPipeline& p, const FragmentKey& key, const frontend::Shader& shader, const ShaderTraits& t)
      : StageExpander(shader, *p.layout, p.fragmentImages, key.images), pipeline_(p), traits_(t), flat_(isFlat(key.rows)),
        wide_(key.numerics == ir::Numerics::Oracle) {}

  void declare(ir::Builder& b) {
    const GraphicsState& s = pipeline_.state;
    for (uint64_t imm : writtenOutputs(shader_)) {
      const frontend::InterfaceVariable& v = shader_.outputs[imm >> 32];
      const Place p = place(v, uint32_t(imm));
      if (v.builtIn) {
        if (v.location == kFragDepth) depth_ = b.var(Type::F32);
        if (v.location == kSampleMask) sampleMask_ = b.var(Type::I32);
        if (v.location == kFragStencilRef) stencilRef_ = b.var(Type::I32);
      } else if (p.location < s.colorCount && p.component < 4 && writesColor(s, p.location) && !colors_.count({p.location, p.index})) {
        const bool integer = texture::formatInfo(s.colorFormats[p.location])->isInteger();
        Texel& t = colors_[{p.location, p.index}];
        for (Value& c : t) c = b.var(integer ? Type::I32 : Type::F32);
      }
      // Coverage is made from it even where no attachment takes it.
      if (s.alphaToCoverage && !alpha_ && !v.builtIn && p == Place{0, 3, 0} && ir::isFloat(v.type)) alpha_ = b.var(Type::F32);
    }
    if (shader_.mayDiscard) killed_ = b.var(Type::Mask);
  }
  //! Interpolates at the start of the shader, where every lane that runs it is active.
  void begin(ir::Builder& b, Value x, Value y, Value covered, Value depth, Value coverage, Value rasterized) {
    x_ = x, y_ = y, covered_ = covered, fragDepth_ = depth, coverage_ = coverage, rasterized_ = rasterized;
    centreX_ = traits_.perSample ? b.input(Type::F32, kSlotCentreX) : x;
    centreY_ = traits_.perSample ? b.input(Type::F32, kSlotCentreY) : y;
    for (uint32_t i = 0; i < pipeline_.link.varyings.size(); ++i) values_.push_back(interpolate(b, i, x, y));
  }

  Value killed() const { return killed_; }
  Value depth() const { return depth_; }
  Value sampleMask() const { return sampleMask_; }
  Value stencilRef() const { return stencilRef_; }
  Value alpha() const { return alpha_; }
  bool writes(uint32_t attachment) const { return colors_.count({attachment, 0}) != 0; }
  Texel color(ir::Builder& b, uint32_t attachment, uint32_t index) const {
    Texel t;
    auto it = colors_.find({attachment, index});
    for (uint32_t c = 0; c < 4; ++c) t[c] = it == colors_.end() ? b.f32(0) : b.get(it->second[c]);
    return t;
  }

  Value shaderInput(ir::Builder& b, Type type, uint32_t variable, uint32_t component, std::span<const Value> operands) override {
    auto it = pipeline_.link.varyingOf.find(uint64_t(variable) << 32 | component);
    if (it == pipeline_.link.varyingOf.end()) return b.zero(type);
    Value v = values_[it->second];
    if (is64Bit(type)) {
      auto high = pipeline_.link.highWordOf.find(uint64_t(variable) << 32 | component);
      if (high == pipeline_.link.highWordOf.end()) return b.zero(type);
      const Value words[2] = {toType(b, Type::I32, v), toType(b, Type::I32, values_[high->second])};
      const Value wide = b.shl(b.convert(ir::Op::ZExt, Type::I64, words[1]), b.i64(32));
      return toType(b, type, b.or_(b.convert(ir::Op::ZExt, Type::I64, words[0]), wide));
    }
    if (pipeline_.link.varyings[it->second].mode == raster::VaryingMode::Flat && wide_ && ir::isFloat(type))
      return keepDouble(b, type, b.quadLoad(Type::F64, planeOffset(kPlaneVaryings + it->second, true)));
    if (pipeline_.link.varyings[it->second].mode == raster::VaryingMode::Flat)
      return toType(b, type, ir::isFloat(type) ? toType(b, Type::F32, v) : v);
    if (operands.size() == 2)   // interpolateAtOffset
      v = interpolate(b, it->second, b.fadd(centreX_, operands[0]), b.fadd(centreY_, operands[1]));
    else if (operands.size() == 1 && pipeline_.state.samples > 1)   // interpolateAtSample
      v = interpolateAtSample(b, it->second, [&](uint32_t s) { return b.ieq(operands[0], b.i32(s)); });
    else if (shader_.inputs[variable].sampling == frontend::SampleLocation::Centroid && pipeline_.state.samples > 1 && !traits_.perSample)
      v = interpolateAtSample(b, it->second, [&](uint32_t s) { return centroidSample(b, s); });
    return wide_ ? keepDouble(b, type, v) : toType(b, type, v);
  }

  void shaderOutput(ir::Builder& b, uint32_t variable, uint32_t component, Value value, std::span<const Value>) override {
    const frontend::InterfaceVariable& v = shader_.outputs[variable];
    const Place p = place(v, component);
    if (v.builtIn) {
      if (v.location == kFragDepth) b.set(depth_, toType(b, Type::F32, value));
      if (v.location == kSampleMask && component == 0) b.set(sampleMask_, toType(b, Type::I32, value));
      if (v.location == kFragStencilRef) b.set(stencilRef_, toType(b, Type::I32, value));
      return;
    }
    if (alpha_ && p == Place{0, 3, 0}) b.set(alpha_, toType(b, Type::F32, value));
    auto it = colors_.find({p.location, p.index});
    if (it == colors_.end() || p.component > 3) return;
    const Value target = it->second[p.component];
    if (v.isSigned && ir::isInt(v.type) && ir::typeBytes(v.type) < 4) value = b.convert(ir::Op::SExt, Type::I32, value);
    b.set(target, toType(b, b.type(target), value));
  }

  Value builtin(ir::Builder& b, Type type, uint32_t builtIn, uint32_t component) override {
    if (auto it = pipeline_.link.builtInOf.find(uint64_t(builtIn) << 32 | component); it != pipeline_.link.builtInOf.end())
      return toType(b, type, values_[it->second]);
    return toType(b, type, builtinValue(b, builtIn, component));
  }

  std::vector<Value> image(ir::Builder& b, const ir::ImageOpInfo& op, std::span<const Value> given) override {
    if (op.dim != ir::ImageDim::SubpassData) return StageExpander::image(b, op, given);
    // Coordinates of an input attachment are relative to the pixel.
    std::vector<Value> operands(given.begin(), given.end());
    operands[2] = b.iadd(operands[2], b.convert(Op::FToS, Type::I32, builtinValue(b, kFragCoord, 0)));
    operands[3] = b.iadd(operands[3], b.convert(Op::FToS, Type::I32, builtinValue(b, kFragCoord, 1)));
    // The layer is that of the primitive; in multiview it is the view.
    ir::ImageOpInfo layered = op;
    layered.arrayed = true;
    Value layer = PUMICE_DRAW_FIELD(b, I32, viewIndex);
    if (pipeline_.link.layerRow >= 0) layer = b.iadd(layer, builtinValue(b, kLayer, 0));
    operands.insert(operands.begin() + 4, layer);
    return StageExpander::image(b, layered, operands);
  }

  void demote(ir::Builder& b) override {
    if (killed_) b.set(killed_, b.mask(true));
  }
  Value helperMask(ir::Builder& b) override {
    Value m = covered_ ? b.maskNot(covered_) : b.mask(false);
    return killed_ ? b.maskOr(m, b.get(killed_)) : m;
  }

 protected:
  Value suppressed(ir::Builder& b) override { return traits_.guarded ? helperMask(b) : 0; }

 private:
  Value interpolate(ir::Builder& b, uint32_t varying, Value x, Value y);
  //! At the location of the first sample that chosen(sample) picks, or at the pixel's centre.
  template <typename Chosen>
  Value interpolateAtSample(ir::Builder& b, uint32_t varying, Chosen&& chosen) {
    const auto locations = raster::sampleLocations(pipeline_.state.samples);
    Value dx = b.f32(0), dy = b.f32(0);
    for (uint32_t s = uint32_t(locations.size()); s-- > 0;) {
      const Value here = chosen(s);
      dx = b.select(here, b.f32(float(locations[s][0]) / 16.f - 0.5f), dx);
      dy = b.select(here, b.f32(float(locations[s][1]) / 16.f - 0.5f), dy);
    }
    return interpolate(b, varying, b.fadd(centreX_, dx), b.fadd(centreY_, dy));
  }
  //! A pixel that is covered whole is shaded at its centre, another at its first covered sample.
  Value centroidSample(ir::Builder& b, uint32_t sample) {
    const uint32_t all = (1u << pipeline_.state.samples) - 1;
    return b.maskAnd(b.ine(b.and_(rasterized_, b.i32(1u << sample)), b.i32(0)), b.ine(rasterized_, b.i32(all)));
  }
  Value builtinValue(ir::Builder& b, uint32_t builtIn, uint32_t component);

  const GraphicsPipeline& pipeline_;
  const ShaderTraits& traits_;
  const bool flat_;   //!< 1/w is 1
  const bool wide_;   //!< records are
  std::map<std::pair<uint32_t, uint32_t>, Texel> colors_;   // (attachment, index) -> variables
  Value depth_ = 0, sampleMask_ = 0, stencilRef_ = 0, alpha_ = 0, killed_ = 0;
  Value x_ = 0, y_ = 0, covered_ = 0, fragDepth_ = 0, coverage_ = 0;
  Value centreX_ = 0, centreY_ = 0;   // of the pixel; x_ and y_ are where it is shaded
  Value rasterized_ = 0;   // coverage before the sample mask: what centroid is made of
  std::vector<Value> values_;
};

//! The one way to evaluate a plane, for depth and varyings alike.
Value evaluatePlane(ir::Builder& b, bool wide, uint32_t plane, Value x, Value y) {
  const uint32_t at = planeOffset(plane, wide);
  if (wide) {
    const Value origin = b.quadLoad(Type::F64, at), dx = b.quadLoad(Type::F64, at + 8), dy = b.quadLoad(Type::F64, at + 16);
    return keepDouble(b, Type::F32, b.fma(dx, keepDouble(b, Type::F64, x), b.fma(dy, keepDouble(b, Type::F64, y), origin)));
  }
  const Value origin = b.quadLoad(Type::F32, at), dx = b.quadLoad(Type::F32, at + 4), dy = b.quadLoad(Type::F32, at + 8);
  return b.fma(dx, x, b.fma(dy, y, origin));
}

Value FragmentExpander::interpolate(ir::Builder& b, uint32_t varying, Value x, Value y) {
  const raster::VaryingMode mode = pipeline_.link.varyings[varying].mode;
  if (mode == raster::VaryingMode::Flat) return b.quadLoad(Type::I32, planeOffset(kPlaneVaryings + varying, wide_));
  const Value v = evaluatePlane(b, wide_, kPlaneVaryings + varying, x, y);
  if (mode != raster::VaryingMode::Perspective || flat_) return v;   // times 1 is what it was
  return b.fmul(v, b.fdiv(b.f32(1), evaluatePlane(b, wide_, kPlaneInverseW, x, y)));
}

Value FragmentExpander::builtinValue(ir::Builder& b, uint32_t builtIn, uint32_t component) {
  switch (builtIn) {
    case kFragCoord:
      if (component == 0) return b.fadd(x_, b.quadLoad(Type::F32, offsetof(raster::RecordHeader, cellX)));
      if (component == 1) return b.fadd(y_, b.quadLoad(Type::F32, offsetof(raster::RecordHeader, cellY)));
      return component == 2 ? fragDepth_ : flat_ ? b.f32(1) : evaluatePlane(b, wide_, kPlaneInverseW, x_, y_);
    case kFrontFacing: return b.ine(b.quadLoad(Type::I32, offsetof(raster::RecordHeader, frontFacing)), b.i32(0));
    case kPrimitiveId: return b.quadLoad(Type::I32, offsetof(raster::RecordHeader, primitiveId));
    case kSampleMask: return coverage_;
    case kSampleId: return traits_.perSample ? b.input(Type::I32, kSlotSample) : b.i32(0);
    case kSamplePosition:
      if (!traits_.perSample) return b.f32(0.5f);
      return b.fadd(component ? b.fsub(y_, centreY_) : b.fsub(x_, centreX_), b.f32(0.5f));
    case kLayer: return b.quadLoad(Type::I32, offsetof(raster::RecordHeader, layer));
    case kViewportIndex: return b.quadLoad(Type::I32, offsetof(raster::RecordHeader, viewport));
    case kDeviceIndex: return b.i32(0);
    case kClipDistance: case kCullDistance: return b.f32(0);   // the vertex shader does not write it
    case kHelperInvocation: return helperMask(b);
    case kViewIndex: return PUMICE_DRAW_FIELD(b, I32, viewIndex);
    default: break;
  }
  fail(base::errorf("built-in %u is not supported", builtIn).message);
  return b.i32(0);
}

Value clampDepth(ir::Builder& b, const GraphicsPipeline& pipeline, Value depth, bool fromShader) {
  const GraphicsState& s = pipeline.state;
  const texture::FormatInfo* f = texture::formatInfo(s.depthStencilFormat);
  if (!f || !f->hasDepth()) return depth;
  // Clipping leaves depths in the viewport's range but for rounding; a bias or the shader may leave it on purpose.
  if (!s.depthClamp && (s.depthBias || fromShader || !s.depthClip)) {
    const raster::DepthRange range = freeDepths(s);
    return b.fmin(b.fmax(depth, b.f32(range.low)), b.f32(range.high));
  }
  const bool chosen = pipeline.link.viewportRow >= 0;
  const Value n = chosen ? b.quadLoad(Type::F32, offsetof(raster::RecordHeader, minDepth)) : PUMICE_DRAW_FIELD(b, F32, minDepth);
  const Value m = chosen ? b.quadLoad(Type::F32, offsetof(raster::RecordHeader, maxDepth)) : PUMICE_DRAW_FIELD(b, F32, maxDepth);
  return b.fmin(b.fmax(depth, b.fmin(n, m)), b.fmax(n, m));
}

}  // namespace

raster::DepthRange freeDepths(const GraphicsState& s) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  return s.unrestrictedDepth ? raster::DepthRange{-kInfinity, kInfinity} : raster::DepthRange{};
}

//! Whether a shader can tell which samples of its pixel are covered.
static bool seesCoverage(const frontend::Shader& shader) {
  const std::vector<ir::Inst>& insts = shader.function.insts;
  return std::any_of(insts.begin(), insts.end(), [](const ir::Inst& i) { return i.op == Op::Builtin && uint32_t(i.imm >> 32) == kSampleMask; }) ||
         std::any_of(shader.inputs.begin(), shader.inputs.end(), [](const frontend::InterfaceVariable& i) { return i.sampling == frontend::SampleLocation::Centroid; });
}

bool hasEffect(const GraphicsState& s, const frontend::Shader& shader) {
  if (s.alphaToCoverage || s.decisions || shader.mayDiscard || shader.writesMemory || ir::wantedChecks()) return true;
  const std::vector<uint64_t> written = writtenOutputs(shader);
  return std::any_of(written.begin(), written.end(), [&](uint64_t imm) {
    const frontend::InterfaceVariable& o = shader.outputs[imm >> 32];
    const uint32_t a = place(o, uint32_t(imm)).location;
    return o.builtIn || (a < s.colorCount && writesColor(s, a));
  });
}

VisibilityTraits visibilityTraits(const GraphicsPipeline& p) {
  VisibilityTraits v;
  const GraphicsState& s = p.state;
  const frontend::Shader* shader = p.fragment.get();
  const ShaderTraits t = traits(s, shader);
  const texture::FormatInfo* f = texture::formatInfo(s.depthStencilFormat);
  const bool hasDepth = f && f->hasDepth(), hasStencil = f && f->hasStencil();
  const uint32_t all = (1u << s.samples) - 1;
  v.sampleMask = s.sampleMask & all;
  v.depth.test = hasDepth && s.depthTest;
  v.depth.write = v.depth.test && s.depthWrite;
  v.depth.compare = s.depthCompare;
  v.planeDepth = !(shader && shader->writesDepth);
  if (shader) {
    for (uint64_t imm : writtenOutputs(*shader)) {
      const frontend::InterfaceVariable& o = shader->outputs[imm >> 32];
      const uint32_t a = place(o, uint32_t(imm)).location;
      if (o.builtIn || o.index != 0 || a >= s.colorCount || !writesColor(s, a)) continue;
      v.written |= uint8_t(1u << a);
      if (replacesColor(s, a) && !shader->mayDiscard) v.replaced |= uint8_t(1u << a);
    }
    v.readsAttachments = s.feedbackLoop || std::any_of(shader->resources.begin(), shader->resources.end(), [](const frontend::Resource& r) {
      return r.kind == frontend::ResourceKind::InputAttachment;
    });
  }
  v.oneColor = s.numerics == ir::Numerics::F32 && !s.decisions && !testsSamples(s) && v.sampleMask == all && !t.perSample && !s.alphaToCoverage &&
               !t.writesSampleMask && !v.readsAttachments && !(shader && seesCoverage(*shader));
  // The oracle has depths of its own. Decisions are recorded fragment by fragment.
  if (s.numerics != ir::Numerics::F32 || s.decisions || (hasStencil && s.stencilTest) || (hasDepth && s.depthBoundsTest)) return v;
  v.hiZ = v.depth.test && v.planeDepth && !(shader && shader->writesMemory);
  if (!t.early || t.perSample || t.guarded || s.alphaToCoverage || t.writesSampleMask) return v;
  if (shader) {
    if (shader->writesMemory || shader->mayDiscard || shader->writesDepth) return v;
    if (v.written != v.replaced) return v;
    v.colors = v.written;
    // What tells the visible part of a primitive from the rest of it.
    for (const ir::Inst& i : shader->function.insts) {
      const uint32_t builtIn = uint32_t(i.imm >> 32);
      if (i.op == Op::Builtin && (builtIn == kSampleMask || builtIn == kHelperInvocation)) return v;
      if (i.op == Op::HelperMask || (i.op >= Op::SubgroupAny && i.op <= Op::SubgroupReduce)) return v;
    }
    if (s.samples > 1)
      for (const frontend::InterfaceVariable& i : shader->inputs)
        if (i.sampling == frontend::SampleLocation::Centroid) return v;
  }
  v.opaque = v.colors || v.depth.test;
  return v;
}

static std::string pixelText(const interp::ExecContext& context, uint32_t lane) {
  raster::RecordHeader header;
  std::memcpy(&header, context.quadRecords[lane / 4], sizeof header);
  const float x = static_cast<const float*>(context.inputs[kSlotX])[lane], y = static_cast<const float*>(context.inputs[kSlotY])[lane];
  char text[64];
  std::snprintf(text, sizeof text, "pixel (%d, %d)", int(header.cellX + x), int(header.cellY + y));
  return text;
}

namespace {

//! SavedRoutine::traits
enum MadeTraits : uint32_t {
  kPresent = 1,        //!< it has an effect
  kReadsRecord = 2,
  kReadsInverseW = 4,
  kClampsVaryings = 8,
};

base::Result<std::shared_ptr<FragmentRoutine>> compile(const GraphicsPipeline& pipeline, const FragmentKey& key, const SavedRoutine& made, base::ThreadPool* workers) {
  const GraphicsState& state = pipeline.state;
  const frontend::Shader* shader = pipeline.fragment.get();
  const ShaderTraits t = traits(state, shader);
  auto routine = std::make_shared<FragmentRoutine>();
  routine->varyings = pipeline.link.varyings;
  routine->wide = key.numerics == ir::Numerics::Oracle;
  routine->needsHelpers = t.needsHelpers;
  routine->perSample = t.perSample;
  routine->present = made.traits & kPresent;
  const ir::Function& f = made.function;
  if (key.rows == Rows::Any && key.numerics == ir::Numerics::F32 &&
      std::none_of(f.insts.begin(), f.insts.end(), [](const ir::Inst& i) { return i.op == Op::Check; })) {
    const uint32_t allSamples = (1u << state.samples) - 1;
    const bool masked = (state.sampleMask & allSamples) != allSamples;
    const bool wholeOnes = !(disabledIdeas() & bit(Idea::WholeBlocks)) && !t.perSample && !masked && !key.countSamples && !key.statistics && !state.decisions;
    const bool oneColor = wholeOnes && state.samples > 1 && (key.settled || pipeline.visibility.oneColor);
    const bool readsW = made.traits & kReadsInverseW;
    const bool clamps = (made.traits & kClampsVaryings) && !(disabledIdeas() & bit(Idea::InUnit));
    const bool wanted[kRowKinds] = {false, !(disabledIdeas() & bit(Idea::OneRecord)) && (made.traits & kReadsRecord), wholeOnes, wholeOnes && readsW,
                                    wholeOnes && clamps, oneColor, oneColor && readsW, oneColor && clamps};
    for (uint32_t kind = 1; kind < kRowKinds; ++kind) {
      if (!wanted[kind]) continue;
      routine->siblings[kind] = std::make_unique<FragmentRoutine::Sibling>();
      routine->siblings[kind]->make = [&pipeline, other = key, kind]() mutable -> std::unique_ptr<FragmentRoutine> {
        other.rows = Rows(kind);
        auto sibling = buildFragmentRoutine(pipeline, other);
        if (!sibling) base::logError("fragment routine for rows of a kind: %s", sibling.error().message.c_str());
        return sibling ? std::make_unique<FragmentRoutine>(std::move(**sibling)) : nullptr;
      };
    }
  }
  auto code = compileRoutine(f, key.numerics, {"fragment shader \"" + (shader ? shader->function.name : "") + "\"", pixelText}, key.rows >= Rows::Whole, workers);
  if (!code) return std::move(code).error();
  routine->code = std::move(code).value();
  return routine;
}

//! Offsets of the planes that rows in the unit interval speak of.
std::vector<uint32_t> planesInUnit(const GraphicsPipeline& pipeline) {
  std::vector<uint32_t> all;
  for (uint32_t i = 0; i < pipeline.link.varyings.size(); ++i)
    if (pipeline.link.varyings[i].mode != raster::VaryingMode::Flat) all.push_back(planeOffset(kPlaneVaryings + i));
  return all;
}

//! v is held above 0 or below 1.
bool isClamp(const ir::Function& f, Value v) {
  const ir::Inst& i = f.insts[v];
  if ((i.op != Op::FMax && i.op != Op::FMin) || i.type != Type::F32) return false;
  for (Value o : f.operands(v))
    if (f.insts[o].op == Op::Const && (i.op == Op::FMax ? ir::floatValue(i.type, f.insts[o].imm) <= 0 : ir::floatValue(i.type, f.insts[o].imm) >= 1)) return true;
  return false;
}

//! Whether varyings are clamped as they come.
bool clampsVaryings(const ir::Function& f) {
  const auto operandIs = [&](Value v, auto&& is) {
    const auto o = f.operands(v);
    return std::any_of(o.begin(), o.end(), is);
  };
  const auto isPlane = [&](Value v) {
    return f.insts[v].op == Op::Fma && f.insts[f.operands(v)[2]].op == Op::Fma && operandIs(f.operands(v)[2], [&](Value o) {
             return f.insts[o].op == Op::QuadLoad && uint32_t(f.insts[o].imm) >= planeOffset(kPlaneVaryings);
           });
  };
  for (Value v = 1; v < f.insts.size(); ++v)
    if (isClamp(f, v) && operandIs(v, [&](Value o) { return isPlane(o) || (f.insts[o].op == Op::FMul && operandIs(o, isPlane)); })) return true;
  return false;
}

//! Takes away clamps of what is known to lie between 0 and 1.
void dropClamps(ir::Function& f) {
  std::vector<Value> same(f.insts.size());
  for (Value v = 0; v < f.insts.size(); ++v) {
    same[v] = v;
    const ir::Inst& i = f.insts[v];
    for (uint32_t k = 0; k < i.operandCount; ++k)
      if (Value& o = f.operandPool[i.firstOperand + k]; o < v) o = same[o];
    if (!v || !isClamp(f, v)) continue;
    for (Value o : f.operands(v))
      if (ir::isPlaneInUnit(f, o)) same[v] = o;
  }
}

Surroundings surroundings(const GraphicsPipeline& pipeline, const FragmentKey& key) {
  const GraphicsState& state = pipeline.state;
  const bool perSample = traits(state, pipeline.fragment.get()).perSample, wide = key.numerics == ir::Numerics::Oracle;
  Surroundings s;
  s.sets = uint32_t(pipeline.layout->sets.size());
  s.inputs = {Type::F32, Type::F32, Type::I32};
  if (perSample) s.inputs.insert(s.inputs.end(), {Type::I32, Type::F32, Type::F32});
  s.outputs = {key.countSamples ? Type::I32 : Type::None, key.statistics ? Type::I32 : Type::None};
  s.recordBytes = (wide ? raster::wideRecordBytes : raster::recordBytes)(uint32_t(pipeline.link.varyings.size()));
  s.oneRecord = key.rows != Rows::Any;
  if (isInUnit(key.rows)) s.inUnit = planesInUnit(pipeline);
  s.planes.resize(kRowPlanes);
  const texture::FormatInfo* depthFormat = texture::formatInfo(state.depthStencilFormat);
  for (uint32_t sample = 0; sample < (perSample ? 1 : state.samples); ++sample) {
    for (uint32_t a = 0; a < state.colorCount; ++a)
      if (writesColor(state, a)) s.planes[colorPlane(a, sample, state.samples)] = texture::formatInfo(state.colorFormats[a])->elementBytes;
    if (depthFormat && depthFormat->hasDepth() && (state.depthTest || state.depthBoundsTest)) s.planes[depthPlane(sample, state.samples)] = depthFormat->elementBytes;
    if (depthFormat && depthFormat->hasStencil() && state.stencilTest) s.planes[stencilPlane(sample, state.samples)] = 1;
    if (state.decisions) s.planes[decisionPlane(sample, state.samples)] = 4;
  }
  return s;
}

}  // namespace

std::shared_ptr<FragmentRoutine> restoreFragmentRoutine(const GraphicsPipeline& pipeline, const FragmentKey& key, base::ThreadPool* workers) {
  if (!pipeline.saved) return nullptr;
  const auto saved = pipeline.saved->find(savedKey(key), surroundings(pipeline, key));
  if (!saved) return nullptr;
  auto made = compile(pipeline, key, *saved, workers);
  if (!made) return nullptr;
  countRestored();
  return std::move(made).value();
}

base::Result<std::shared_ptr<FragmentRoutine>> buildFragmentRoutine(const GraphicsPipeline& pipeline, const FragmentKey& key, base::ThreadPool* workers) {
  if (auto restored = restoreFragmentRoutine(pipeline, key, workers)) return restored;
  const GraphicsState& state = pipeline.state;
  const frontend::Shader* shader = pipeline.fragment.get();
  const ShaderTraits t = traits(state, shader);
  const bool wide = key.numerics == ir::Numerics::Oracle;

  SavedRoutine made;
  ir::Function& f = made.function;
  f.name = "fragment routine";
  ir::Builder b(f);
  const frontend::Shader none;
  FragmentExpander expander(pipeline, key, shader ? *shader : none, t);
  if (shader) expander.declare(b);

  const Value x = b.input(Type::F32, kSlotX), y = b.input(Type::F32, kSlotY);
  Value rasterized = b.input(Type::I32, kSlotCoverage);
  Value coverage = rasterized;
  const uint32_t samples = t.perSample ? 1 : state.samples;   // that this code deals with
  const uint32_t allSamples = (1u << state.samples) - 1;
  const Value sampleNumber = t.perSample ? b.input(Type::I32, kSlotSample) : 0;
  const auto sampleBit = [&](uint32_t s) { return t.perSample ? b.shl(b.i32(1), sampleNumber) : b.i32(1u << s); };
  const bool masked = (state.sampleMask & allSamples) != allSamples;
  const bool whole = key.rows >= Rows::Whole;
  // Of blocks of one colour the first sample's is written, for all.
  const uint32_t stored = key.rows >= Rows::WholeOne ? 1 : samples;
  if (whole) rasterized = coverage = b.i32(allSamples);
  if (masked && !key.settled) coverage = b.and_(coverage, b.i32(state.sampleMask & allSamples));
  const Value passed = key.countSamples ? b.var(Type::I32) : 0;
  const Value shaded = key.statistics ? b.var(Type::I32) : 0;

  const auto locations = raster::sampleLocations(samples);
  const auto depthAt = [&](uint32_t sample) {
    if (samples == 1) return clampDepth(b, pipeline, evaluatePlane(b, wide, kPlaneDepth, x, y), false);
    const Value sx = b.fadd(x, b.f32(float(locations[sample][0]) / 16.f - 0.5f));
    const Value sy = b.fadd(y, b.f32(float(locations[sample][1]) / 16.f - 0.5f));
    return clampDepth(b, pipeline, evaluatePlane(b, wide, kPlaneDepth, sx, sy), false);
  };

  if (t.perSample) coverage = b.and_(coverage, sampleBit(0));
  // What is decided, from the primitive on.
  const Value decisions = state.decisions ? b.var(Type::I32) : 0;
  if (decisions) {
    const Value vertices = b.quadLoad(Type::I32, planeOffset(kPlaneVaryings + pipeline.link.decisionVarying, wide));
    const Value primitive = ir::mixDecision(b, b.quadLoad(Type::I32, offsetof(raster::RecordHeader, primitiveId)), PUMICE_DRAW_FIELD(b, I32, passDraw));
    b.set(decisions, ir::mixDecision(b, primitive, vertices));
  }
  Value decisionsFirst = 0, decisionsEnd = 0;
  std::vector<Value> live(samples, 0);   // 0: all active lanes
  for (uint32_t s = 0; s < samples; ++s) {
    if (whole) live[s] = 0;
    else if (samples > 1) live[s] = b.ine(b.and_(coverage, b.i32(1u << s)), b.i32(0));
    else if (t.needsHelpers || (masked && !key.settled) || t.perSample) live[s] = b.ine(coverage, b.i32(0));
    if (t.early && !key.settled) live[s] = testSample(b, state, s, live[s], depthAt(s));
  }
  Value any = live[0];
  for (uint32_t s = 1; s < samples; ++s) any = any && live[s] ? b.maskOr(any, live[s]) : 0;

  // A row of settled fragments holds no quad for nothing, and where no helpers are needed no lane.
  if (key.settled && !t.needsHelpers) any = 0;
  const Value run = key.settled ? 0 : any && t.needsHelpers ? quadAny(b, any) : any;
  if (run) b.beginIf(run);
  if (shader) {
    if (shaded) b.set(shaded, any ? b.select(any, b.i32(1), b.i32(0)) : b.i32(1));
    expander.begin(b, x, y, any, clampDepth(b, pipeline, evaluatePlane(b, wide, kPlaneDepth, x, y), false), coverage, rasterized);
    decisionsFirst = Value(f.insts.size());
    if (t.guarded) ir::inlineShader(b, guardEffects(shader->function), expander);
    else ir::inlineShader(b, shader->function, expander);
    decisionsEnd = Value(f.insts.size());
  }
  const Value alive = expander.killed() ? b.maskNot(b.get(expander.killed())) : 0;
  const Value shaderDepth = expander.depth() && !(shader && shader->earlyFragmentTests)
                                ? clampDepth(b, pipeline, b.get(expander.depth()), true) : 0;
  const Value stencilRef = expander.stencilRef() ? b.get(expander.stencilRef()) : 0;
  std::vector<Texel> colors(state.colorCount), colors1(state.colorCount);
  for (uint32_t a = 0; a < state.colorCount; ++a)
    if (expander.writes(a)) colors[a] = expander.color(b, a, 0), colors1[a] = expander.color(b, a, 1);
  const Value alpha = expander.alpha() ? b.get(expander.alpha()) : 0;
  if (state.alphaToOne)
    for (uint32_t a = 0; a < state.colorCount; ++a)
      for (Texel* texel : {&colors[a], &colors1[a]})
        if (expander.writes(a) && ir::isFloat(b.type((*texel)[3]))) (*texel)[3] = b.f32(1);

  // Nothing is left of what was decided before where every attachment is replaced.
  bool replaces = true;
  for (uint32_t a = 0; a < state.colorCount; ++a)
    if (state.colorFormats[a] != VK_FORMAT_UNDEFINED) replaces &= expander.writes(a) && replacesColor(state, a);

  for (uint32_t s = 0; s < stored; ++s) {
    live[s] = both(b, live[s], alive);
    if (expander.sampleMask())
      live[s] = both(b, live[s], b.ine(b.and_(b.get(expander.sampleMask()), sampleBit(s)), b.i32(0)));
    if (state.alphaToCoverage && alpha) {
      const Value number = t.perSample ? b.convert(Op::SToF, Type::F32, sampleNumber) : b.f32(float(s));
      live[s] = both(b, live[s], b.fle(b.fmul(b.fadd(number, b.f32(0.5f)), b.f32(1.0f / float(state.samples))), alpha));
    }
    if (!t.early && !key.settled) live[s] = testSample(b, state, s, live[s], shaderDepth ? shaderDepth : depthAt(s), stencilRef);
    const bool guarded = live[s] && live[s] != run;
    if (guarded) b.beginIf(live[s]);
    for (uint32_t a = 0; a < state.colorCount; ++a)
      if (expander.writes(a)) writeColor(b, state, a, s, colors[a], colors1[a]);
    if (passed) b.set(passed, b.or_(b.get(passed), b.i32(1u << s)));
    if (decisions) {
      const uint32_t plane = decisionPlane(s, state.samples);
      const Value own = b.get(decisions);
      b.tileStore(plane, 4, 0, replaces ? own : ir::mixDecision(b, b.tileLoad(Type::I32, plane, 4, 0), own));
    }
    if (guarded) b.endIf();
  }
  if (run) b.endIf();
  if (passed) b.output(kSlotPassed, b.get(passed));
  if (shaded) b.output(kSlotShaded, b.get(shaded));
  if (!expander.error().empty()) return base::Error{expander.error()};

  const texture::FormatInfo* depthFormat = texture::formatInfo(state.depthStencilFormat);
  bool effects = key.countSamples || (shader && shader->writesMemory);
  if (depthFormat && depthFormat->hasDepth()) effects |= state.depthTest && state.depthWrite;
  if (depthFormat && depthFormat->hasStencil()) effects |= state.stencilTest;
  for (uint32_t a = 0; a < state.colorCount; ++a) effects |= expander.writes(a);
  if (effects) made.traits |= kPresent;

  if (decisions) ir::recordDecisions(f, decisionsFirst, decisionsEnd, decisions);
  for (ir::Inst& i : f.insts) {
    if (i.op != Op::QuadLoad) continue;
    made.traits |= kReadsRecord;
    if (i.imm - planeOffset(kPlaneInverseW) < 12) made.traits |= kReadsInverseW;
    if (key.rows != Rows::Any) i.imm |= ir::kOneRecord;
  }
  if (isInUnit(key.rows))
    for (const uint32_t at : planesInUnit(pipeline))
      for (ir::Inst& i : f.insts)
        if (i.op == Op::QuadLoad && uint32_t(i.imm) == at) i.imm |= ir::kPlaneInUnit;
  PUMICE_TRY(finishRoutine(f));
  if (isInUnit(key.rows)) {
    dropClamps(f);
    ir::optimise(f);
  } else if (key.rows == Rows::Any && clampsVaryings(f)) {
    made.traits |= kClampsVaryings;
  }
  if (pipeline.saved) pipeline.saved->insert(savedKey(key), f, made.traits);
  return compile(pipeline, key, made, workers);
}

}  // namespace pumice::pipeline
