// Vulkan as the driver sees it: no prototypes (our functions live in pumice::icd), the window systems we serve.
#pragma once

#define VK_NO_PROTOTYPES
#define VK_USE_PLATFORM_XCB_KHR
#define VK_USE_PLATFORM_XLIB_KHR
#define VK_USE_PLATFORM_WAYLAND_KHR
#include <vulkan/vulkan.h>
// Xlib's macros clash with ordinary names.
#undef None
#undef Bool
#undef Status
#undef Success
#undef Always
// The extensions younger than the system's headers (gen/newer_registry.xml).
#include <newer_vulkan.h>
