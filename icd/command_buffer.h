// Command buffers: a list of typed commands in an arena, with the state each draw needs captured at its recording.
#pragma once

#include <new>
#include <span>
#include <vector>

#include "icd/captured_draw.h"
#include "icd/command_arena.h"
#include "icd/descriptors.h"
#include "icd/extended_state.h"
#include "icd/pipelines.h"
#include "icd/render_pass.h"
#include "icd/sync.h"
#include "pipeline/execute.h"

namespace pumice::icd {

//! A recorded command: a node of the command buffer's list.
struct Execution;
struct Command {
  Command* next = nullptr;
  void (*run)(Command*, Execution&) = nullptr;
  void (*destroy)(Command*) = nullptr;
};

//! What the queue's thread carries from command to command.
struct Execution {
  Execution(Device& d, SyncHub& h) : device(d), pool(d.pool), hub(h), pass(d.pool) {}
  Device& device;
  base::ThreadPool& pool;
  SyncHub& hub;
  pipeline::PassExecutor pass;
  StateReader states;
  // The render pass that is open
  const RenderPass* renderPass = nullptr;
  const Framebuffer* framebuffer = nullptr;
  std::span<ImageView* const> views;
  std::span<const VkClearValue> clears;
  VkRect2D area{};
  uint32_t subpass = 0;
  bool insidePass = false;
  pipeline::PassBegin rendering;              //!< dynamic rendering; then renderPass is null
  // Multiview: the commands of a subpass run once for each view of its mask, each time on one layer of the attachments.
  uint32_t viewMask = 0;                      //!< the view that runs (lowest bit) and those still to come; 0: no multiview
  uint32_t viewOrdinal = 0;                   //!< views of this subpass that have run
  Command* current = nullptr;                 //!< being executed
  Command* scopeStart = nullptr;              //!< first command of the subpass
  Command* jump = nullptr;                    //!< where execution goes on, if not at the next command
  bool skips = false;                         //!< conditional rendering: draws, dispatches and clears of attachments do nothing
  // Occlusion
  Query* occlusion = nullptr;                 //!< begun, not ended
  Query* statistics = nullptr;                //!< the same
  std::vector<Query*> finishing;              //!< ended in the pass that is open
  std::vector<Query*> timestamps;             //!< to be written when the draws before them have run: with the pass

  void beginPass(const pipeline::PassBegin& begin);
  void endPass();
  //! Begins a subpass or a dynamic rendering scope with its first view.
  void beginScope(uint32_t mask);
  //! Ends the view. True: there is another one, and its commands run next.
  bool endView();
  //! In multiview each view has its own query, from the one that is named.
  uint32_t queryOffset() const { return insidePass ? viewOrdinal : 0; }

 private:
  void beginView();
};

struct CommandPool;

struct CommandBuffer : Dispatchable {
  CommandBuffer(Device& d, CommandPool& p, const HostAllocator& a, VkCommandBufferLevel l) : device(d), pool(p), level(l), arena(a) {}
  ~CommandBuffer() { reset(); }

  //! Appends a command: anything callable with an Execution&. Dropped, and vkEndCommandBuffer fails, when memory runs out.
  template <typename F>
  void record(F&& f) {
    using Plain = std::decay_t<F>;
    struct Node : Command {
      explicit Node(F&& f) : body(std::forward<F>(f)) {}
      Plain body;
    };
    void* memory = arena.allocBytes(sizeof(Node), alignof(Node));
    if (!memory) {
      outOfMemory = true;
      return;
    }
    auto* node = new (memory) Node(std::forward<F>(f));
    node->run = [](Command* c, Execution& e) { static_cast<Node*>(c)->body(e); };
    node->destroy = [](Command* c) { static_cast<Node*>(c)->~Node(); };
    *tail = node;
    tail = &node->next;
  }
  //! Copies an array of the application's into the arena.
  template <typename T>
  std::span<const T> keep(const T* data, uint32_t count) {
    auto copy = arena.copy(std::span<const T>(data, count));
    if (count && !copy.data()) outOfMemory = true;
    return copy;
  }
  void reset();
  void execute(Execution& e) const;

  Device& device;
  CommandPool& pool;
  VkCommandBufferLevel level;
  CommandBuffer *previous = nullptr, *next = nullptr;   //!< of the pool
  CommandArena arena;
  Command* head = nullptr;
  Command** tail = &head;
  bool outOfMemory = false;
  bool waitsForEvents = false;                     //!< vkCmdWaitEvents, in secondary command buffers too

  // Recording state. What the pipeline may or may not take from the command buffer is kept apart and merged when a
  // draw captures it.
  pipeline::DrawState draw;
  pipeline::DispatchState dispatch;
  struct Dynamic {
    VkViewport viewports[raster::kMaxViewports] = {};
    VkRect2D scissors[raster::kMaxViewports] = {};
    float lineWidth = 1, depthBias[3] = {}, blendConstants[4] = {}, depthBounds[2] = {0, 1};
    uint32_t stencilReference[2] = {}, stencilCompareMask[2] = {}, stencilWriteMask[2] = {};
  } dynamic;
  //! Memory of pushed sets, in the arena.
  const std::byte *pushedDraw[ir::kMaxDescriptorSets] = {}, *pushedDispatch[ir::kMaxDescriptorSets] = {};
  ExtendedState extended;
  PipelineFamily* family = nullptr;                //!< of the bound pipeline, when it leaves extended state dynamic
  bool isCaptured = false;                         //!< nothing changed since:
  CapturedDraw captured;                           //!< of the last draw; in the arena
  bool isMerged = false;                           //!< pipeline, `dynamic` and `extended` are as `draw` has them
  StateChunks touched = 0;                         //!< where `draw` may differ from captured.whole
  //! To be called after a change of the pipeline, of `dynamic` or of `extended`.
  void stateChanged() { isCaptured = isMerged = false; }
  //! After a change of these elements of `draw`.
  template <typename T>
  void valuesChanged(const T* first, size_t count) {
    if (count) touched |= chunksOf(size_t(reinterpret_cast<const std::byte*>(first) - stateChunk(draw, 0)), count * sizeof(T));
    isCaptured = false;
  }
  //! False: there is nothing to draw with.
  bool captureDraw();

 private:
  bool mergeState();
};

struct CommandPool {
  explicit CommandPool(HostAllocator a) : allocator(a) {}
  ~CommandPool();
  HostAllocator allocator;
  PoolList<CommandBuffer> buffers;
};

PUMICE_HANDLE(CommandBuffer, VkCommandBuffer)
PUMICE_HANDLE(CommandPool, VkCommandPool)

}  // namespace pumice::icd
