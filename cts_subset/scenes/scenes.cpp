#include "cts_subset/harness/scene.h"

namespace pumice::cts {

const std::vector<Scene>& allScenes() {
  static const SceneList kScenes = [] {
    SceneList scenes;
    addBasicScenes(scenes);
    addCoverageScenes(scenes);
    addDepthScenes(scenes);
    addTextureScenes(scenes);
    addStateScenes(scenes);
    addShaderScenes(scenes);
    addInputScenes(scenes);
    addHeavyScenes(scenes);
    addMultisampleScenes(scenes);
    addPrimitiveScenes(scenes);
    addOutputScenes(scenes);
    addSampleRateScenes(scenes);
    addPassScenes(scenes);
    addTechniqueScenes(scenes);
    addDepthPrecisionScenes(scenes);
    addTransparencyScenes(scenes);
    addGeometryScenes(scenes);
    addAntialiasingScenes(scenes);
    return scenes;
  }();
  return kScenes;
}

}  // namespace pumice::cts
