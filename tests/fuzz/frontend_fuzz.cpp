// Fuzzes the frontend: any words must give a shader that verifies or an error, soon and within moderate memory.
//
// With clang this is a libFuzzer target (PUMICE_FUZZ=ON, see tests/fuzz/README.md). Otherwise main() replays the files and
// folders it is given.
#include <cstdint>
#include <cstring>
#include <vector>

#include "spirv_interp/frontend/module.h"
#include "spirv_interp/frontend/shader.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

using namespace pumice;

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::vector<uint32_t> words(size / 4);
  if (!words.empty()) std::memcpy(words.data(), data, words.size() * 4);

  // Without the validator, so that our own checks have to hold; and, for one input in four, with it.
  frontend::Module unchecked;
  unchecked.words = words;
  if (!unchecked.cut()) return 0;
  for (frontend::Stage stage : {frontend::Stage::Vertex, frontend::Stage::Fragment, frontend::Stage::Compute})
    (void)frontend::translate(unchecked, stage, "main", {}).hasValue();
  if (words.size() % 4 == 0) {
    auto module = frontend::parseModule(words);
    if (module)
      for (frontend::Stage stage : {frontend::Stage::Vertex, frontend::Stage::Fragment, frontend::Stage::Compute}) {
        auto shader = frontend::translate(**module, stage, "main", {});
        // What the validator takes must not trip our own verifier.
        if (!shader && shader.error().message.find("internal error") != std::string::npos) __builtin_trap();
      }
  }
  return 0;
}
