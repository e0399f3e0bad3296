// What shaders read and compute: push constants, uniform blocks, built-ins, control flow.
#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;

std::vector<Vertex> square(const glm::uvec2& canvas, double x, double y, double side, glm::vec4 attribute) {
  Vertex a{atPixel(canvas, x, y), attribute}, b{atPixel(canvas, x + side, y), attribute};
  Vertex c{atPixel(canvas, x + side, y + side), attribute}, d{atPixel(canvas, x, y + side), attribute};
  return {a, b, c, a, c, d};
}

std::vector<Vertex> wholePicture() {
  // Attributes run over the picture from 0 to 1.
  return {{{-1, -1, 0, 1}, {0, 0, 0, 1}}, {{3, -1, 0, 1}, {2, 0, 1, 1}}, {{-1, 3, 0, 1}, {0, 2, 1, 1}}};
}

Picture renderPushConstants(Device& device, Variant variant) {
  Canvas canvas(device, kSize, 64);
  struct Push {
    glm::vec4 offset;  // vertex stage
    glm::vec4 colour;  // fragment stage
    glm::vec4 scale;
  };
  PipelineSpec spec;
  spec.vertex = R"(#version 450
layout(location = 0) in vec4 position;
layout(push_constant) uniform Push { vec4 offset; } push;
void main() { gl_Position = position + push.offset; }
)";
  spec.fragment = R"(#version 450
layout(location = 0) out vec4 colour;
layout(push_constant) uniform Push { layout(offset = 16) vec4 colour; vec4 scale; } push;
void main() { colour = push.colour * push.scale; }
)";
  spec.pushConstants = {{VK_SHADER_STAGE_VERTEX_BIT, 0, 16}, {VK_SHADER_STAGE_FRAGMENT_BIT, 16, 32}};
  Pipeline pipeline = canvas.pipeline(spec);
  auto vertices = square(canvas.size(), 4, 4, 24, {});
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
    canvas.bindVertices(commands, vertices);
    Push push{{}, {0.95f, 0.9f, 0.5f, 1}, {1, 1, 1, 1}};
    vkCmdPushConstants(commands, pipeline.layout, VK_SHADER_STAGE_FRAGMENT_BIT, 16, 32, &push.colour);
    for (int i = 0; i < 8; ++i) {
      push.offset = {float(i) * 0.25f, i % 2 ? 1.0f : 0.0f, 0, 0};
      vkCmdPushConstants(commands, pipeline.layout, VK_SHADER_STAGE_VERTEX_BIT, 0, 16, &push.offset);
      // Only a part: the rest must keep its value.
      glm::vec2 part(0.1f * float(i + 1), variant == Variant::kBroken ? 0.5f : 1.0f);
      vkCmdPushConstants(commands, pipeline.layout, VK_SHADER_STAGE_FRAGMENT_BIT, 32, 8, &part);
      vkCmdDraw(commands, 6, 1, 0, 0);
    }
  });
}

Picture renderDynamicUniform(Device& device, Variant variant) {
  Canvas canvas(device, kSize, 64);
  VkDeviceSize stride = std::max<VkDeviceSize>(device.properties.limits.minUniformBufferOffsetAlignment, 64);
  struct Block {
    glm::vec4 colour;
    glm::vec2 offset;
    float gain[2];  // std140 would spread an array; these are two floats
  };
  std::vector<std::byte> bytes(stride * 8);
  for (int i = 0; i < 8; ++i) {
    Block block{{0.1f * float(i), 1 - 0.1f * float(i), 0.5f, 1},
                {0.25f * float(i), i % 2 ? 1.0f : 0.0f},
                {0.9f, 0.1f}};
    std::memcpy(&bytes[stride * size_t(i)], &block, sizeof block);
  }
  Buffer uniform = canvas.bufferOf(bytes, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT);
  Binding binding{VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC};
  binding.buffer = {uniform.handle, 0, sizeof(Block)};
  DescriptorSet set = canvas.descriptors({binding});
  PipelineSpec spec;
  const std::string kBlock =
      "layout(set = 0, binding = 0) uniform Block {\n"
      "  vec4 colour; vec2 offset; float gain; float base; } block;\n";
  spec.vertex = "#version 450\nlayout(location = 0) in vec4 position;\n" + kBlock +
                "void main() { gl_Position = position + vec4(block.offset, 0, 0); }\n";
  spec.fragment = "#version 450\nlayout(location = 0) out vec4 colour;\n" + kBlock +
                  "void main() { colour = block.colour * block.gain + block.base; }\n";
  spec.sets = {set.layout};
  Pipeline pipeline = canvas.pipeline(spec);
  auto vertices = square(canvas.size(), 4, 4, 24, {});
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
    canvas.bindVertices(commands, vertices);
    for (uint32_t i = 0; i < 8; ++i) {
      uint32_t chosen = variant == Variant::kBroken && i == 3 ? 2 : i;
      uint32_t offset = uint32_t(stride * chosen);
      vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1, &set.handle,
                              1, &offset);
      vkCmdDraw(commands, 6, 1, 0, 0);
    }
  });
}

// A fragment shader over the whole picture; `broken` is the same with one deliberate error.
Scene fragmentScene(const std::string& name, const std::string& body, const std::string& good,
                    const std::string& bad, const std::string& broken) {
  auto build = [body, good, bad](Variant variant) {
    std::string text =
        "#version 450\n"
        "layout(location = 0) in vec4 passed;\n"
        "layout(location = 0) out vec4 colour;\n" +
        body;
    if (variant == Variant::kBroken) text.replace(text.find(good), good.size(), bad);
    return text;
  };
  Scene scene;
  scene.name = name;
  scene.broken = broken;
  scene.render = [build](Device& device, Variant variant) {
    Canvas canvas(device, kSize, kSize);
    PipelineSpec spec;
    spec.fragment = build(variant);
    Pipeline pipeline = canvas.pipeline(spec);
    return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
      canvas.drawVertices(commands, pipeline, wholePicture());
    });
  };
  return scene;
}

// Built without vertex buffers: gl_VertexIndex and gl_InstanceIndex choose everything.
Picture renderIndexBuiltins(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  PipelineSpec spec;
  spec.vertex = R"(#version 450
layout(location = 0) flat out vec4 passed;
const vec2 corners[6] = vec2[](vec2(0, 0), vec2(1, 0), vec2(1, 1), vec2(0, 0), vec2(1, 1), vec2(0, 1));
void main() {
    vec2 cell = vec2(gl_InstanceIndex % 8, gl_InstanceIndex / 8);
    vec2 p = (cell + 0.125 + 0.75 * corners[gl_VertexIndex % 6]) / 4.0 - 1.0;
    gl_Position = vec4(p, 0.0, 1.0);
    passed = vec4(cell / 7.0, float(gl_VertexIndex) / 12.0, 1.0);
}
)";
  spec.fragment = R"(#version 450
layout(location = 0) flat in vec4 passed;
layout(location = 0) out vec4 colour;
void main() { colour = passed; }
)";
  // No vertex input at all: one binding that is never read would hide an error.
  spec.bindings = {{0, 4, VK_VERTEX_INPUT_RATE_VERTEX}};
  spec.attributes = {};
  Pipeline pipeline = canvas.pipeline(spec);
  Buffer unused = canvas.buffer(64, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &unused.handle, &offset);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
    vkCmdDraw(commands, 6, 40, 0, 0);
    vkCmdDraw(commands, 6, 20, 6, variant == Variant::kBroken ? 43 : 44);
  });
}

Picture renderSpecialization(Device& device, Variant variant) {
  Canvas canvas(device, kSize, 64);
  PipelineSpec spec;
  spec.fragment = R"(#version 450
layout(constant_id = 0) const int kind = 0;
layout(constant_id = 3) const float gain = 0.25;
layout(constant_id = 7) const bool invert = false;
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() {
    vec3 c = vec3(0.0);
    switch (kind) {
    case 0: c = passed.xyz; break;
    case 1: c = passed.zxy; break;
    case 2: c = vec3(passed.x * passed.y); break;
    default: c = vec3(0.5); break;
    }
    colour = vec4(invert ? 1.0 - c * gain : c * gain, 1.0);
}
)";
  const VkSpecializationMapEntry kEntries[] = {{0, 0, 4}, {3, 4, 4}, {7, 8, 4}};
  struct Values {
    int32_t kind;
    float gain;
    VkBool32 invert;
  };
  std::vector<Pipeline> pipelines;
  for (int i = 0; i < 8; ++i) {
    Values values{i % 4, i < 4 ? 1.0f : 0.6f, i % 3 == 0};
    if (variant == Variant::kBroken && i == 6) values.kind = 0;
    VkSpecializationInfo info{3, kEntries, sizeof values, &values};
    spec.fragmentSpecialization = &info;
    pipelines.push_back(canvas.pipeline(spec));
  }
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    for (int i = 0; i < 8; ++i) {
      setViewport(commands, float(i * 32), 0, 32, 64);
      setScissor(commands, i * 32, 0, 32, 64);
      canvas.drawVertices(commands, pipelines[i], wholePicture());
    }
  });
}

}  // namespace

void addShaderScenes(SceneList& scenes) {
  Scene push;
  push.name = "push_constants";
  push.broken = "one component keeps an old value";
  push.render = renderPushConstants;
  scenes.push_back(push);

  Scene uniform;
  uniform.name = "uniform_dynamic_offset";
  uniform.broken = "one draw with its neighbour's offset";
  uniform.render = renderDynamicUniform;
  scenes.push_back(uniform);

  Scene builtins;
  builtins.name = "vertex_and_instance_index";
  builtins.broken = "firstInstance one too low";
  builtins.render = renderIndexBuiltins;
  scenes.push_back(builtins);

  Scene constants;
  constants.name = "specialization_constants";
  constants.broken = "one pipeline with the wrong constant";
  constants.render = renderSpecialization;
  scenes.push_back(constants);

  scenes.push_back(
      fragmentScene("frag_coord",
                    "void main() { colour = vec4(gl_FragCoord.xy / 256.0, gl_FragCoord.z + 0.25, "
                    "gl_FragCoord.w); }\n",
                    "gl_FragCoord.xy", "(gl_FragCoord.xy + 1.5)", "positions 1.5 px off"));
  scenes.push_back(fragmentScene("discard_pattern",
                                 "void main() { ivec2 p = ivec2(gl_FragCoord.xy);\n"
                                 "  if (((p.x >> 3) ^ (p.y >> 2)) % 3 == 0) discard;\n"
                                 "  colour = vec4(passed.xy, 0.5, 1.0); }\n",
                                 "% 3 == 0", "% 3 == 1", "the wrong pixels discarded"));
  scenes.push_back(
      fragmentScene("loops_and_branches",
                    "void main() {\n"
                    "  ivec2 p = ivec2(gl_FragCoord.xy);\n"
                    "  int n = (p.x * 7 + p.y * 13) % 17; float s = 0.0; int steps = 0;\n"
                    "  for (int i = 0; i < 40; ++i) {\n"
                    "    if (i == n) break;\n"
                    "    if ((i & 3) == (p.x & 3)) continue;\n"
                    "    s += 0.0625; ++steps;\n"
                    "    while (steps > 9) { steps -= 4; if (p.y % 5 == 0) break; s += 0.03125; }\n"
                    "  }\n"
                    "  colour = vec4(s, float(n) / 17.0, float(steps) / 12.0, 1.0); }\n",
                    "steps -= 4", "steps -= 3", "a loop that counts differently"));
  scenes.push_back(
      fragmentScene("integer_arithmetic",
                    "uint hash(uint x) { x ^= x >> 16; x *= 0x7feb352du; x ^= x >> 15; x *= 0x846ca68bu;\n"
                    "  return x ^ (x >> 16); }\n"
                    "void main() { uvec2 p = uvec2(gl_FragCoord.xy); uint h = hash(p.x * 256u + p.y);\n"
                    "  int s = int(h) >> 5; uint d = h / (p.x + 1u) + h % (p.y + 1u);\n"
                    "  colour = vec4(float(h & 255u), float((s ^ (s >> 9)) & 255), float(d & 255u),\n"
                    "    float(bitfieldExtract(h, 9, 8))) / 255.0; }\n",
                    "0x7feb352du", "0x7feb352fu", "another multiplier"));
  scenes.push_back(
      fragmentScene("float_functions",
                    "void main() { vec2 p = passed.xy * 6.0 - 3.0;\n"
                    "  float a = sin(p.x) * cos(p.y), b = exp2(-dot(p, p)), c = sqrt(abs(p.x * p.y)) / 3.0;\n"
                    "  float d = log2(1.0 + length(p)) / 3.0, e = pow(abs(p.x) * 0.3, 1.7);\n"
                    "  vec3 n = normalize(vec3(p, 1.5));\n"
                    "  colour = vec4(a * 0.5 + 0.5, clamp(b + c * 0.5, 0.0, 1.0),\n"
                    "    mix(d, e, smoothstep(-1.0, 1.0, n.x)), 1.0)\n"
                    "    * (0.6 + 0.4 * max(dot(n, reflect(vec3(0.3, 0.2, -0.8), n)), 0.0)); }\n",
                    "cos(p.y)", "cos(p.y + 0.05)", "an angle 0.05 off"));
  scenes.push_back(
      fragmentScene("derivatives",
                    "void main() { vec2 q = passed.xy * passed.xy;\n"
                    "  vec2 dx = dFdx(q), dy = dFdy(q);\n"
                    "  colour = vec4(dx.x * 80.0, dy.y * 80.0, fwidth(q.x + q.y) * 40.0, 1.0); }\n",
                    "dFdx(q)", "dFdx(q * 1.1)", "a derivative 10 % too large"));
  scenes.push_back(
      fragmentScene("matrices",
                    "void main() { mat3 m = mat3(0.8, 0.3, -0.1, -0.2, 0.7, 0.4, 0.5, -0.3, 0.6);\n"
                    "  m = transpose(m) * m; m[1] *= 0.5; vec3 v = m * passed.xyz;\n"
                    "  colour = vec4(abs(v) * 0.8 + inverse(m)[2] * 0.05, determinant(m)); }\n",
                    "m[1] *= 0.5", "m[1] *= 0.6", "a column scaled wrongly"));
}

}  // namespace pumice::cts
