// What shader operations mean whatever the stage: descriptors, images, demotion. The stages' expanders derive from it.
#pragma once

#include "pipeline/link.h"
#include "spirv_interp/ir/passes.h"
#include "texture/builders.h"

namespace pumice::pipeline {

//! A value converted to the type an abstract operation promises: same bits for 32-bit types, else a conversion of the value.
ir::Value toType(ir::Builder& b, ir::Type want, ir::Value v);

//! A conversion between f64 and a smaller float that rounds nothing in the oracle, to hand doubles from one routine to the next.
ir::Value keepDouble(ir::Builder& b, ir::Type want, ir::Value v);

//! DrawConstants' field as a draw-rate value.
#define PUMICE_DRAW_FIELD(b, type, field) (b).uniform(ir::Type::type, uint32_t(offsetof(DrawConstants, field)))
inline ir::Value drawField(ir::Builder& b, ir::Type type, size_t offset, uint32_t index) {
  return b.uniform(type, uint32_t(offset + index * ir::typeBytes(type)));
}

class StageExpander : public ir::Expander {
 public:
  StageExpander(const frontend::Shader& shader, const Layout& layout, const ImageUses& uses, std::span<const ImageState> images)
      : shader_(shader), layout_(layout), uses_(uses), images_(images) {}

  Buffer descriptor(ir::Builder& b, uint32_t resource, ir::Value arrayElement) override;
  std::vector<ir::Value> image(ir::Builder& b, const ir::ImageOpInfo& op, std::span<const ir::Value> operands) override;
  ir::Value shaderInput(ir::Builder& b, ir::Type type, uint32_t variable, uint32_t component, std::span<const ir::Value> operands) override;
  void shaderOutput(ir::Builder& b, uint32_t variable, uint32_t component, ir::Value value, std::span<const ir::Value> operands) override;
  void demote(ir::Builder&) override {}
  ir::Value helperMask(ir::Builder& b) override { return b.mask(false); }

  //! Empty, or what could not be expanded.
  const std::string& error() const { return error_; }

 protected:
  //! Lanes for which an image write or atomic must not happen; 0 = none.
  virtual ir::Value suppressed(ir::Builder&) { return 0; }
  void fail(std::string reason) {
    if (error_.empty()) error_ = std::move(reason);
  }

  const frontend::Shader& shader_;
  const Layout& layout_;

 private:
  struct Element {          // one way to expand an image operation
    ImageState image, sampler;
    bool operator==(const Element&) const = default;
  };
  texture::ImageRef imageRef(ir::Builder& b, uint32_t resource, ir::Value element, const ImageState& state);
  texture::SamplerRef samplerRef(ir::Builder& b, uint32_t resource, ir::Value element, const ImageState& state);
  //! The states that the element's descriptor may be in.
  std::vector<ImageState> states(ir::Builder& b, uint32_t resource, ir::Value element) const;
  //! With specialised sampling turned off: the ways to sample that a routine made before the sampler is known would have to hold.
  static void addUsualSamplers(std::vector<Element>& groups);
  //! Lanes whose descriptor is in the state.
  ir::Value inState(ir::Builder& b, uint32_t resource, ir::Value element, const texture::ViewKey& key);
  ir::Value inState(ir::Builder& b, uint32_t resource, ir::Value element, const texture::SamplerKey& key);

  const ImageUses& uses_;
  std::span<const ImageState> images_;
  std::string error_;
};

//! Verifies and optimises a routine whose expansion is complete.
base::Status finishRoutine(ir::Function& f);

//! A copy of the shader's function in which memory is only changed where `helper.mask` is false.
ir::Function guardEffects(const ir::Function& f);

}  // namespace pumice::pipeline
