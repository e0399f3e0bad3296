// How a visual's pixels lie in memory, and how ours become such (X Window System Protocol, section 8).
#pragma once

#include <xcb/xcb.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace pumice::icd {

struct X11Visual {
  uint8_t depth = 24;
  uint8_t bytes = 4;       //!< per pixel: 2 or 4
  uint32_t pad = 4;        //!< rows are multiples of so many bytes
  uint32_t masks[3] = {};  //!< red, green, blue

  uint32_t pitch(uint32_t width) const { return (width * bytes + pad - 1) / pad * pad; }
  //! Bits beside the colours that mean something: alpha.
  uint32_t rest() const { return depth == 32 ? ~(masks[0] | masks[1] | masks[2]) : 0; }
  //! B8G8R8A8 in memory is what it wants.
  bool isBgra() const { return bytes == 4 && masks[0] == 0xff0000 && masks[1] == 0xff00 && masks[2] == 0xff; }
};

//! Nothing for palettes, pixels of 1 or 3 bytes and servers of the other byte order.
std::optional<X11Visual> x11Visual(const xcb_setup_t* setup, xcb_visualid_t visual);

//! Turns rows of B8G8R8A8 into a visual's pixels, opaque.
class X11Packer {
 public:
  explicit X11Packer(const X11Visual& visual);
  void pack(const std::byte* bgra, uint32_t bgraPitch, std::byte* out, uint32_t width, uint32_t height) const;

 private:
  X11Visual visual_;
  uint32_t table_[3][256];  //!< of each channel's values: the bits they become
};

}  // namespace pumice::icd
