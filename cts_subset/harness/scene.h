// A scene: one picture that every driver must draw alike.
#pragma once

#include "cts_subset/harness/canvas.h"
#include "cts_subset/harness/compare.h"

#include <functional>
#include <string>
#include <vector>

namespace pumice::cts {

// kBroken draws with one deliberate error, of the kind a driver might make. The comparison of a
// broken picture with a good one must fail; that shows that the scene can fail.
enum class Variant { kGood, kBroken };

// How far the default's picture may be from the oracle's (PUMICE_NUMERICS=reference, which computes in double).
struct OracleBound {
  int units = 1;                  // of the format: pixels within that are near
  double share = 0.001;           // of all pixels may be beyond: those that decided otherwise (harness/oracle.h)
  const char* cause = nullptr;    // must be given where the bound is looser than this
};

struct Scene {
  std::string name;
  std::string broken;  // what the broken variant does wrong
  std::function<Picture(Device&, Variant)> render;
  std::function<Expectation()> expectation = [] { return Expectation{}; };
  OracleBound oracle = {};
  // False when the device does not report a format or feature that the scene needs.
  std::function<bool(const Device&)> supported = [](const Device&) { return true; };
  // A truth about the good picture alone; returns what is wrong, or nothing.
  std::function<std::string(const Picture&)> verify = [](const Picture&) { return std::string(); };
};

const std::vector<Scene>& allScenes();

using SceneList = std::vector<Scene>;
void addBasicScenes(SceneList& scenes);
void addCoverageScenes(SceneList& scenes);
void addDepthScenes(SceneList& scenes);
void addTextureScenes(SceneList& scenes);
void addStateScenes(SceneList& scenes);
void addShaderScenes(SceneList& scenes);
void addInputScenes(SceneList& scenes);
void addHeavyScenes(SceneList& scenes);
void addMultisampleScenes(SceneList& scenes);
void addPrimitiveScenes(SceneList& scenes);
void addOutputScenes(SceneList& scenes);
void addSampleRateScenes(SceneList& scenes);
void addPassScenes(SceneList& scenes);
void addTechniqueScenes(SceneList& scenes);
void addDepthPrecisionScenes(SceneList& scenes);
void addTransparencyScenes(SceneList& scenes);
void addGeometryScenes(SceneList& scenes);
void addAntialiasingScenes(SceneList& scenes);

}  // namespace pumice::cts
