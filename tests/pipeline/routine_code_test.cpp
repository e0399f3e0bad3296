// Routines that workers emit while the application goes on.
#include <gtest/gtest.h>

#include <condition_variable>
#include <mutex>

#include "pipeline/saved_routines.h"
#include "spirv_interp/jit/engine.h"
#include "spirv_interp/jit/jit.h"
#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

//! A pool of two whose worker does nothing before release().
struct Held {
  base::ThreadPool workers{2};
  std::mutex mutex;
  std::condition_variable changed;
  bool held = false, open = false;
  std::shared_ptr<base::Task> holding = std::make_shared<base::Task>([this] {
    std::unique_lock lock(mutex);
    held = true;
    changed.notify_all();
    changed.wait(lock, [this] { return open; });
  });
  Held() {
    workers.post(holding);
    std::unique_lock lock(mutex);
    changed.wait(lock, [this] { return held; });
  }
  ~Held() { release(); }
  void release() {
    {
      std::lock_guard lock(mutex);
      open = true;
    }
    changed.notify_all();
    holding->finish();
  }
};

struct Made : ::testing::Test {
  Scene scene{64, 64};
  //! Each call asks for code that nothing before has made.
  std::shared_ptr<GraphicsPipeline> make(base::ThreadPool* workers, float number) {
    const std::string constant = std::to_string(number);
    auto v = compile(frontend::Stage::Vertex, kColorVertex);
    auto f = compile(frontend::Stage::Fragment, "#version 450\nlayout(location = 0) in vec4 color;\nlayout(location = 0) out vec4 target;\nvoid main() { target = color * " + constant +
                                                    " + 0.125; }\n");
    auto p = createGraphicsPipeline(scene.state(), std::make_shared<Layout>(), v, f, {.store = nullptr, .workers = workers});
    EXPECT_TRUE(p.hasValue()) << (p ? "" : p.error().message);
    return p ? *p : nullptr;
  }
  std::vector<std::byte> draw(std::shared_ptr<GraphicsPipeline> pipeline) {
    const DrawState d = scene.drawState(std::move(pipeline));
    scene.begin(0.1f, 0.2f, 0.3f, 1);
    scene.draw(d, triangle(scene, {3, 5, 60, 19, 13, 61}, 0.5f, {0.9f, 0.1f, 0.4f, 0.7f}));
    scene.end();
    return {scene.color.bytes.begin(), scene.color.bytes.end()};
  }
  void SetUp() override {
    if (!jit::emitsCode()) GTEST_SKIP() << "the interpreter is asked for";
  }
};
using EmittedBeside = Made;

TEST_F(EmittedBeside, CreationDoesNotWaitAndTheDrawDoes) {
  const auto expected = draw(make(nullptr, 0.40625f));
  Held held;
  const uint64_t before = jit::statistics().emitted;
  auto pipeline = make(&held.workers, 0.40627f);
  EXPECT_EQ(jit::statistics().emitted, before) << "something was emitted at once";
  const auto other = draw(std::move(pipeline));   // the worker does nothing: who draws does it
  EXPECT_GT(jit::statistics().emitted, before);
  EXPECT_NE(other, std::vector<std::byte>(other.size()));
  auto again = make(&held.workers, 0.40625f);
  EXPECT_EQ(draw(std::move(again)), expected);
}

TEST_F(EmittedBeside, WorkersDoIt) {
  base::ThreadPool workers(2);
  const uint64_t before = jit::statistics().emitted;
  const auto pipeline = make(&workers, 0.28125f);
  for (int i = 0; i < 5000 && jit::statistics().emitted == before; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_GT(jit::statistics().emitted, before);
  const auto with = draw(pipeline);
  EXPECT_EQ(with, draw(make(nullptr, 0.28125f)));
}

TEST_F(EmittedBeside, EqualPipelinesShareWhatIsInTheMaking) {
  draw(make(nullptr, 0.96875f));   // what any pass needs is there afterwards
  Held held;
  const auto emittedFor = [&](int count, float value) {
    const uint64_t before = jit::statistics().emitted;
    std::vector<std::shared_ptr<GraphicsPipeline>> pipelines;
    for (int i = 0; i < count; ++i) pipelines.push_back(make(&held.workers, value));
    for (auto& pipeline : pipelines) draw(pipeline);
    return jit::statistics().emitted - before;
  };
  emittedFor(1, 0.84375f);   // what all share: the vertex routine
  EXPECT_EQ(emittedFor(10, 0.71875f), emittedFor(1, 0.78125f));
}

TEST_F(EmittedBeside, AVertexShaderIsLinkedOnceForPipelinesThatDifferInTheirFragments) {
  const auto vertex = compile(frontend::Stage::Vertex, kColorVertex);
  const auto fragment = [&](const char* number) {
    return compile(frontend::Stage::Fragment, std::string("#version 450\nlayout(location = 0) in vec4 color;\nlayout(location = 0) out vec4 target;\nvoid main() { target = color * ") + number + "; }\n");
  };
  const auto with = [&](std::shared_ptr<const frontend::Shader> v, std::shared_ptr<const frontend::Shader> f, GraphicsState state) {
    auto p = createGraphicsPipeline(std::move(state), std::make_shared<Layout>(), std::move(v), std::move(f));
    EXPECT_TRUE(p.hasValue()) << (p ? "" : p.error().message);
    return p ? *p : nullptr;
  };
  const auto first = with(vertex, fragment("0.53125"), scene.state());
  uint64_t before = routineCounts().linked;
  const auto second = with(vertex, fragment("0.59375"), scene.state());
  EXPECT_EQ(routineCounts().linked - before, 1u) << "the fragment routine";
  GraphicsState other = scene.state();
  other.vertexBindings[0].stride *= 2;
  before = routineCounts().linked;
  const auto third = with(vertex, fragment("0.65625"), other);
  EXPECT_EQ(routineCounts().linked - before, 2u) << "another stride";
  before = routineCounts().linked;
  const auto fourth = with(vertex, fragment("0.59375 + color.wzyx * 0.0"), scene.state());
  EXPECT_EQ(routineCounts().linked - before, 1u) << "the first is still there";
  before = routineCounts().linked;
  const auto fifth = with(compile(frontend::Stage::Vertex, kColorVertex), fragment("0.84375"), scene.state());
  EXPECT_EQ(routineCounts().linked - before, 2u) << "another shader";
  before = routineCounts().linked;
  const auto sixth = with(vertex, fragment("0.71875"), scene.state());
  EXPECT_EQ(routineCounts().linked - before, 1u) << "the first beside it";
  // The pictures are those of pipelines on their own.
  const auto expected = draw(second);
  EXPECT_EQ(draw(with(compile(frontend::Stage::Vertex, kColorVertex), fragment("0.59375"), scene.state())), expected);
}

TEST_F(EmittedBeside, WhatIsDestroyedInTheMeantimeIsNotEmitted) {
  const uint64_t before = jit::statistics().emitted;
  {
    Held held;
    for (int i = 0; i < 10; ++i) make(&held.workers, 0.5f + 0.0625f * float(i) + 0.001f);
    held.release();
    auto last = std::make_shared<base::Task>([] {});
    held.workers.post(last);
    last->finish();
  }
  EXPECT_EQ(jit::statistics().emitted, before);
}

TEST_F(EmittedBeside, PipelinesMayGoWhileTheirsAreEmitted) {
  base::ThreadPool workers(3);
  for (int i = 0; i < 60; ++i) make(&workers, 0.3f + 0.0078125f * float(i) + 0.0003f);
}

}  // namespace
}  // namespace pumice::pipeline::test
