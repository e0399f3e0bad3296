#include "spirv_interp/frontend/count_instructions.h"

#include <bit>
#include <cstring>

#include <spirv-tools/libspirv.h>

namespace {

constexpr size_t kHeaderWords = 5;
constexpr uint32_t kMagic = 0x07230203;
thread_local bool counts = false;

}  // namespace

// Names that the linker's --wrap gives.
extern "C" {

spv_result_t __real_spvBinaryParse(spv_const_context context, void* user, const uint32_t* words, size_t count, spv_parsed_header_fn_t header,
                                   spv_parsed_instruction_fn_t instruction, spv_diagnostic* diagnostic);

spv_result_t __wrap_spvBinaryParse(spv_const_context context, void* user, const uint32_t* words, size_t count, spv_parsed_header_fn_t header,
                                   spv_parsed_instruction_fn_t instruction, spv_diagnostic* diagnostic) {
  // The parse that counts comes first, and wants no messages.
  if (!counts || !header || diagnostic || count < kHeaderWords || words[0] != kMagic) return __real_spvBinaryParse(context, user, words, count, header, instruction, diagnostic);
  counts = false;
  constexpr auto kHost = std::endian::native == std::endian::little ? SPV_ENDIANNESS_LITTLE : SPV_ENDIANNESS_BIG;
  if (const spv_result_t r = header(user, kHost, words[0], words[1], words[2], words[3], words[4])) return r;
  for (size_t at = kHeaderWords; at < count;) {
    spv_parsed_instruction_t i{};
    i.words = words + at;
    i.num_words = uint16_t(words[at] >> 16);
    i.opcode = uint16_t(words[at]);
    if (!i.num_words || i.num_words > count - at) break;   // the parse to come says so
    if (const spv_result_t r = instruction(user, &i)) return r;
    at += i.num_words;
  }
  return SPV_SUCCESS;
}
}

namespace pumice::frontend {

QuickCount::QuickCount() {
  // validation_state.cpp: CountInstructions looks at the opcode alone, setHeader is called before it.
  static const bool known = !std::strcmp(spvSoftwareVersionString(), "v2023.1");
  counts = known;
}
QuickCount::~QuickCount() { counts = false; }

}  // namespace pumice::frontend
