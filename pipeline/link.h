// What connects a pipeline's stages to each other and to descriptors: found once, when the pipeline is made.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "base/result.h"
#include "pipeline/pipeline.h"
#include "pipeline/routine.h"

namespace pumice::pipeline {

//! SPIR-V's numbers of the built-ins that routines give (SPIR-V spec, "BuiltIn").
enum BuiltIn : uint32_t {
  kPosition = 0, kPointSize = 1, kClipDistance = 3, kCullDistance = 4, kPrimitiveId = 7, kLayer = 9, kViewportIndex = 10,
  kFragCoord = 15, kPointCoord = 16, kFrontFacing = 17, kSampleId = 18, kSamplePosition = 19, kSampleMask = 20,
  kFragDepth = 22, kHelperInvocation = 23, kNumWorkgroups = 24, kWorkgroupSize = 25, kWorkgroupId = 26,
  kLocalInvocationId = 27, kGlobalInvocationId = 28, kLocalInvocationIndex = 29, kVertexIndex = 42, kInstanceIndex = 43,
  kBaseVertex = 4424, kBaseInstance = 4425, kDrawIndex = 4426, kDeviceIndex = 4438, kViewIndex = 4440,
  kFragStencilRef = 5014,
};

//! Location and component of one scalar of an interface variable (component = e * 4 + c as in ShaderInput's imm).
struct Place {
  uint32_t location, component, index;
  auto operator<=>(const Place&) const = default;
};
inline Place place(const frontend::InterfaceVariable& v, uint32_t component) {
  return {v.location + component / 4, v.component + component % 4, v.index};
}

//! One of the two words of a 64-bit scalar. Its component is 0 or 1 within the location (see InterfaceVariable).
inline Place wordPlace(const frontend::InterfaceVariable& v, uint32_t component, uint32_t word) {
  return {v.location + component / 4, v.component + component % 4 * 2 + word, v.index};
}
inline bool is64Bit(ir::Type t) { return t == ir::Type::I64 || t == ir::Type::F64; }

//! The interface between the vertex and the fragment stage. Only what the fragment shader statically reads and the
//! vertex shader writes takes part; what is read but not written is zero.
struct StageLink {
  std::map<Place, uint32_t> rows;              //!< vertex output -> row of raster::VertexOutputs
  uint32_t rowCount = 4;
  int32_t pointSizeRow = -1, viewportRow = -1, layerRow = -1;
  int32_t clipDistanceRow = -1, cullDistanceRow = -1;   //!< the first of as many rows
  uint32_t clipDistances = 0, cullDistances = 0;
  int32_t decisionRow = -1;                    //!< GraphicsState::decisions: what the vertices decided
  uint32_t decisionVarying = 0;
  std::vector<raster::Varying> varyings;       //!< order of the planes
  uint32_t unread = 0;                         //!< scalars that the vertex shader writes for nothing
  std::map<uint64_t, uint32_t> varyingOf;      //!< fragment ShaderInput's imm -> index in varyings (64 bits: of the low word)
  std::map<uint64_t, uint32_t> highWordOf;     //!< the same of the high words
  std::map<uint64_t, uint32_t> builtInOf;      //!< fragment Builtin's imm -> index in varyings, for those that are interpolated
};
base::Result<StageLink> linkStages(const GraphicsState& state, const frontend::Shader& vertex, const frontend::Shader* fragment);

//! The scalars that a shader's ShaderOutput instructions write: imm of each.
std::vector<uint64_t> writtenOutputs(const frontend::Shader& shader);

//! Image and sampler descriptors that a shader uses: the order of ImageState in keys.
class ImageUses {
 public:
  static constexpr uint32_t kIndexed = ~0u;   //!< any element: the index is dynamic
  struct Use { uint32_t resource, element; };
  static base::Result<ImageUses> collect(const frontend::Shader& shader, const Layout& layout);
  std::span<const Use> uses() const { return uses_; }
  std::optional<uint32_t> find(uint32_t resource, uint32_t element) const;
  //! The states of the descriptors now in memory, in the order of uses; at least one for each.
  std::vector<ImageState> read(const frontend::Shader& shader, const Layout& layout, const std::byte* const* setMemory,
                               const uint64_t* setSize) const;
  //! States as a common program would have them, for trying a routine before any draw.
  std::vector<ImageState> plausible(const frontend::Shader& shader, const Layout& layout) const;

 private:
  std::vector<Use> uses_;
  void add(uint32_t resource, uint32_t element);
};

//! Checks that every resource of a shader has a binding of a fitting type in the layout.
base::Status checkResources(const frontend::Shader& shader, const Layout& layout);

}  // namespace pumice::pipeline
