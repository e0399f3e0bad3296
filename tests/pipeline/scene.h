// Draws with GLSL shaders into plain memory, for tests.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/execute.h"

namespace pumice::pipeline::test {

//! An image in memory of its own; zero at the start.
struct Image {
  texture::ImageLayout layout;
  std::vector<std::byte> bytes;
  Image(VkFormat format, uint32_t width, uint32_t height, uint32_t layers = 1, uint32_t samples = 1);
  texture::ImageMemory memory() { return {&layout, reinterpret_cast<std::byte*>((uintptr_t(bytes.data()) + 63) & ~uintptr_t(63))}; }
  template <typename T>
  T at(uint32_t x, uint32_t y, VkImageAspectFlags aspect = VK_IMAGE_ASPECT_COLOR_BIT) {
    T v;
    std::memcpy(&v, memory().base + layout.elementOffset(layout.plane(aspect), 0, 0, 0, x, y, 0), sizeof v);
    return v;
  }
  std::array<uint8_t, 4> rgba(uint32_t x, uint32_t y) { return at<std::array<uint8_t, 4>>(x, y); }
};

std::shared_ptr<const frontend::Shader> compile(frontend::Stage stage, const std::string& glsl);

extern const char* const kColorVertex;     //!< vec4 position and vec4 colour from locations 0 and 1
extern const char* const kColorFragment;   //!< vec4 from location 0

struct ColorVertex { float position[4]; float color[4]; };

//! A colour attachment RGBA8 and perhaps depth/stencil; one pass at a time.
class Scene {
 public:
  Scene(uint32_t width, uint32_t height, VkFormat depthFormat = VK_FORMAT_UNDEFINED, unsigned threads = 1,
        VkFormat colorFormat = VK_FORMAT_R8G8B8A8_UNORM);

  //! State with the attachments' formats, and ColorVertex in binding 0.
  GraphicsState state() const;
  std::shared_ptr<GraphicsPipeline> pipeline(GraphicsState state, const std::string& vertex = kColorVertex,
                                             const std::string& fragment = kColorFragment, std::shared_ptr<Layout> layout = nullptr);
  DrawState drawState(std::shared_ptr<GraphicsPipeline> pipeline);
  void begin(float r = 0, float g = 0, float b = 0, float a = 0, float depth = 1, uint32_t stencil = 0);
  void draw(const DrawState& state, const std::vector<ColorVertex>& vertices);
  void draw(const DrawState& state, const DrawParams& params) { executor.draw(state, params); }
  void end() { executor.end(); }

  uint32_t width, height;
  base::ThreadPool pool;
  PassExecutor executor;
  Image color;
  std::unique_ptr<Image> depth;
  PassBegin pass;

 private:
  std::vector<std::unique_ptr<std::vector<ColorVertex>>> kept_;
};

//! A triangle of one colour and depth through pixel coordinates.
std::vector<ColorVertex> triangle(const Scene& scene, std::array<float, 6> xy, float z, std::array<float, 4> color);
//! Two triangles that cover the rectangle.
std::vector<ColorVertex> rectangle(const Scene& scene, float x0, float y0, float x1, float y1, float z, std::array<float, 4> color);

}  // namespace pumice::pipeline::test
